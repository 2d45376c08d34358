"""Maximise: several guesses on a coarse mesh, the best of them on finer ones."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from controller.belief import Gait, WalkerModel
from controller.belief.lumped import H
from controller.common.errors import UserError
from controller.design.orbit import periodic_orbit
from controller.limit.mechanics import Expression
from controller.limit.problem import Program, Task
from controller.limit.question import Answer, Interrupted, Question
from controller.limit.walk import N_P, Motion, Phase

ITERATIONS = 400  # of IPOPT, a guess
TYPICAL = 90.0  # iterations of a guess, for the bar
EASY = (0.9, 0.8, 0.7)  # of the limit, at which the walk of least torque is looked for, to be walked
FEASIBLE = 1e-5  # of the constraints, in their own units: [rad], [rad/s], [m], [10 N.m], [100 N]
AT_BOUND = 0.99  # of the program's own bound of a disturbance

NEUTRAL = {"load": 1.0, "friction": 0.8}
"""Disturbance of a guess where it is not 0."""

Say = Callable[[float, float, str], None]
"""Told what is done, all there is, and words."""
Stop = Callable[[], str | None]
"""Asked at every iteration; a reason ends the search."""
Start = Callable[[Expression], Expression]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Search:
    """All that a search needs besides its question.

    Attributes:
        model: The walker.
        gait: Where the walk starts and ends.
        say: Told how far it is.
        stop: Asked whether to go on.
    """

    model: WalkerModel
    gait: Gait
    say: Say | None = None
    stop: Stop | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Found:
    """What one solve gave.

    Attributes:
        motion: The walk.
        phases: Its structure.
        at_bound: Whether the disturbance stands at the program's own bound.
    """

    motion: Motion
    phases: tuple[Phase, ...]
    at_bound: bool


class _Watch(ca.Callback):
    """Hears of every iteration."""

    def __init__(self, nx: int, ng: int, heard: Callable[[], bool]) -> None:
        ca.Callback.__init__(self)
        self._sizes, self._heard = (nx, ng), heard
        self.construct("watch", {})

    def get_n_in(self) -> int:
        return int(ca.nlpsol_n_out())

    def get_n_out(self) -> int:
        return 1

    def get_sparsity_in(self, i: int) -> Any:
        name = ca.nlpsol_out(i)
        size = {"x": self._sizes[0], "lam_x": self._sizes[0], "g": self._sizes[1], "lam_g": self._sizes[1], "f": 1}
        return ca.Sparsity.dense(size.get(name, 0), 1)

    def eval(self, arg: Any) -> list[int]:
        """Whether to end."""
        return [int(self._heard())]


def answer(question: Question, search: Search, start: Start | None = None) -> Answer:
    """The most of a disturbance that is survived.

    Args:
        question: What is asked.
        search: The walker and who listens.
        start: First link angles and rates (10,) by the disturbance; the gait's state after impact if not given.

    Raises:
        UserError: the question is not legal, or no walk is found.
        Interrupted: the user asked to stop.
    """
    question.check()
    coarse = question.intervals[0]
    walks = question.walks(coarse)
    tally = _Tally(search, len(walks) * question.starts + len(question.intervals))
    rng = np.random.default_rng(0)
    starts: list[float | None] = []
    best: Found | None = None
    for number in range(question.starts):
        values = []
        for phases in walks:
            guess = _guess(search, phases, rng if number else None, NEUTRAL.get(question.what.kind, 0.0))
            found = _solve(question, search, phases, guess, start, tally)
            if found:
                values.append(question.value(found.motion.disturbance))
                if best is None or _better(question, found, best):
                    best = found
        starts.append(max(values, key=lambda value: value * question.what.sign) if values else None)
    if best is None:
        raise UserError(_hopeless(question))
    meshes = {coarse: question.value(best.motion.disturbance)}
    for intervals in question.intervals[1:]:
        phases = tuple(
            Phase(intervals=max(3, round(p.intervals * intervals / coarse)), pushed=p.pushed, lands=p.lands)
            for p in best.phases
        )
        finer = _solve(question, search, phases, _resampled(best.motion, phases), start, tally)
        if finer:
            best = finer
            meshes[intervals] = question.value(finer.motion.disturbance)
        coarse = intervals if finer else coarse
    easy = _easy(question, search, start, tally, best)
    return Answer(
        question=question,
        value=question.value(best.motion.disturbance),
        meshes=meshes,
        starts=tuple(starts),
        at_bound=best.at_bound,
        phases=best.phases,
        motion=best.motion,
        easy=easy.motion if easy else None,
        easy_phases=easy.phases if easy else (),
    )


def _easy(question: Question, search: Search, start: Start | None, tally: "_Tally", best: Found) -> Found | None:
    """The walk of least torque under a share of a push, from the gait's own: one that leaves torque to hold on with."""
    if question.what.kind != "push" or best.at_bound or question.blind:
        return None
    for share in EASY:
        for intervals in reversed(question.intervals):
            for phases in question.walks(intervals):
                force = share * best.motion.disturbance
                found = _solve(question, search, phases, _guess(search, phases, None, force), start, tally, force)
                if found:
                    return found
    return None


class _Tally:
    """Counts iterations for the bar."""

    def __init__(self, search: Search, solves: int) -> None:
        self.search, self.total, self.done, self.iterations = search, solves, 0, 0
        self.stopped = ""

    def heard(self) -> bool:
        self.iterations += 1
        if self.search.say:
            share = self.iterations / (self.iterations + 0.5 * TYPICAL)
            self.search.say(self.done + share, self.total, f"iteration {self.iterations}")
        self.stopped = (self.search.stop() if self.search.stop else None) or ""
        return bool(self.stopped)

    def next(self) -> None:
        self.done, self.iterations = self.done + 1, 0


def _better(question: Question, a: Found, b: Found) -> bool:
    return question.what.sign * (a.motion.disturbance - b.motion.disturbance) > 0.0


def _task(
    question: Question, search: Search, phases: tuple[Phase, ...], start: Start | None, fixed: float | None
) -> Task:
    gait, axis = search.gait, question.what
    q, dq = gait.post_impact(search.model)
    first = ca.DM(np.concatenate((H @ q, H @ dq)))
    last = np.concatenate((H @ gait.q_minus, H @ gait.dq_minus))
    return Task(
        kind=axis.kind,
        sign=axis.sign,
        phases=phases,
        pushed_time=question.pushed_time if axis.kind == "push" else None,
        start=None if axis.free else start or (lambda d: first),
        end=None if axis.free else last,
        ledge_step=question.step,
        elapsed=question.blind,
        fixed=fixed,
    )


def _solve(
    question: Question,
    search: Search,
    phases: tuple[Phase, ...],
    guess: Motion,
    start: Start | None,
    tally: _Tally,
    fixed: float | None = None,
) -> Found | None:
    task = _task(question, search, phases, start, fixed)
    program = Program(search.model, task, question.bounds(search.model, search.gait))
    watch = _Watch(program.x.numel(), program.g.numel(), tally.heard)
    nlp: Any = {"x": program.x, "f": program.f, "g": program.g}
    options: Any = {
        "print_time": False,
        "iteration_callback": watch,
        "ipopt": {"print_level": 0, "sb": "yes", "max_iter": ITERATIONS, "tol": 1e-6},
    }
    solver = ca.nlpsol("limit", "ipopt", nlp, options)
    out = solver(
        x0=np.clip(guess.vector(), program.x_low, program.x_high),
        lbx=program.x_low, ubx=program.x_high, lbg=program.g_low, ubg=program.g_high,
    )  # fmt: skip
    tally.next()
    if tally.stopped:
        raise Interrupted(tally.stopped)
    x, g = (np.array(out[name]).ravel() for name in ("x", "g"))
    missed = max(*(program.g_low - g), *(g - program.g_high), *(program.x_low - x), *(x - program.x_high))
    if not missed < FEASIBLE:  # a walk that keeps everything is one, whether or not it is an optimum
        return None
    motion = Motion.of(x, phases)
    bound = program.x_high[-2] if question.what.sign > 0.0 else program.x_low[-2]
    share = motion.disturbance / bound
    at_bound = share < 1.0 / AT_BOUND if question.what.kind == "friction" else share > AT_BOUND
    return Found(motion=motion, phases=phases, at_bound=bool(at_bound))


def _guess(search: Search, phases: tuple[Phase, ...], rng: np.random.Generator | None, disturbance: float) -> Motion:
    """The gait's own orbit in every step; with a generator, bent and stretched at random."""
    orbit = periodic_orbit(search.model, search.gait)
    points, times = [], []
    began = 0.0
    for phase in phases:
        ends = orbit.step_time if phase.lands else 0.4 * orbit.step_time + 0.6 * began
        t = np.linspace(began, ends, phase.points)
        began = 0.0 if phase.lands else ends
        q, dq, u = (
            np.array([np.interp(t, orbit.t, column) for column in values.T]) for values in (orbit.q, orbit.dq, orbit.u)
        )
        bend, stretch = np.zeros((5, 1)), 1.0
        if rng is not None:
            bend, stretch = 0.15 * rng.normal(size=(5, 1)), rng.uniform(0.7, 1.7)
        q = q + bend * np.sin(np.pi * np.linspace(0.0, 1.0, phase.points))
        ddq = np.gradient(dq, t, axis=1)
        limit = search.model.torque_limits[:, None]
        points.append(np.vstack((H @ q, H @ dq / stretch, H @ ddq / stretch**2, np.clip(u, -limit, limit))))
        times.append(float(t[-1] - t[0]) * stretch)
    return Motion(points=tuple(points), times=tuple(times), disturbance=disturbance)


def _resampled(motion: Motion, phases: tuple[Phase, ...]) -> Motion:
    """The walk on another mesh."""
    points = []
    for z, phase in zip(motion.points, phases, strict=True):
        old, new = np.linspace(0.0, 1.0, z.shape[1]), np.linspace(0.0, 1.0, phase.points)
        points.append(np.array([np.interp(new, old, z[row]) for row in range(N_P)]))
    return Motion(points=tuple(points), times=motion.times, disturbance=motion.disturbance, edge=motion.edge)


def _hopeless(question: Question) -> str:
    return (
        f"{question.words()}: no walk of {question.steps} steps found at friction {question.friction:g}, steps of up "
        f"to {question.longest:g} s, torso within {question.torso:g} rad, from {question.starts} starts; "
        "must allow one: more --friction, --longest-step or --steps, or more --starts"
    )
