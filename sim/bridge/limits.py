"""What `cmpc limit` needs of both worlds: the search on the controller's side, real runs on the plant's."""

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from controller.belief import WalkerModel
from controller.belief.lumped import H
from controller.common import outside
from controller.common.records import Leg
from controller.limit.question import AXES, Answer, Interrupted, Question, times_of, usual_step
from controller.limit.walk import state_at
from sim.bridge.controllers import known_belief
from sim.bridge.run import run_scenario
from sim.errors import UserError
from sim.interface import Vector
from sim.loop import NoTape, RunSummary, Ticks
from sim.scenario import Scenario, with_values
from sim.walkers import ModelFiles

__all__ = [
    "AXES",
    "Answer",
    "Interrupted",
    "Question",
    "ask",
    "check_casadi",
    "fingerprint",
    "replay",
    "usual_step",
    "walk",
]

SAMPLES = 9  # forces at which the blind controller is run
ROUNDS = 3  # of sampling nearer the answer
CHECKED = (0.25, 0.5, 1.0)  # [s] at which the replay is compared

Say = Callable[[float, float, str], None]
Stop = Callable[[], str | None]


def check_casadi() -> None:
    """Refuse to go on without CasADi.

    Raises:
        UserError: it is not installed, or does not work.
    """
    try:
        import controller.limit.solve  # noqa: F401
    except (
        ImportError,
        OSError,
        AttributeError,
    ) as error:  # missing, its libraries not to be loaded, or another package
        missing = isinstance(error, ModuleNotFoundError)
        raise UserError(
            f"cmpc limit: CasADi is missing{'' if missing else f' or does not work ({error})'}; must be installed: "
            "pip install 'cmpc-walker[design]'"
        ) from error


def ask(question: Question, walker: str, gait: str, *, say: Say | None = None, stop: Stop | None = None) -> Answer:
    """How much of a disturbance a walker can survive.

    Args:
        question: What is asked.
        walker: Name or folder.
        gait: Name or file.
        say: Told how far the search is.
        stop: Asked whether to go on.

    Raises:
        UserError: the question is not legal, no walk is found, or CasADi is missing.
        Interrupted: `stop` gave a reason.
    """
    check_casadi()
    from controller.limit.solve import Search, answer

    question.check()
    belief = known_belief(walker, gait)
    search = Search(model=belief.model, gait=belief.gait, say=say, stop=stop)
    if not question.blind:
        found = answer(question, search)
    else:
        found = _blind(question, walker, gait, search)
    if question.what.kind == "push" and not question.blind and not found.at_bound:
        found = dataclasses.replace(found, replay=replay(found, walker, gait))
    return found


class _States(NoTape):
    """Keeps what the plant did."""

    def __init__(self) -> None:
        self.rows: list[Any] = []
        self.stance: list[int] = []

    def ticks(self, ticks: Ticks) -> None:
        """Copy the state."""
        self.rows.extend(np.concatenate((row["q"], row["dq"])) for row in ticks.state)
        self.stance.extend(ticks.judged["stance"].tolist())


def _scenario(question: Question, walker: str, gait: str, **changes: Any) -> Scenario:
    """The rigid plant under the question's ground."""
    scenario = Scenario(walker=walker, gait=gait, steps=question.steps)
    return with_values(
        scenario, {"plant.kind": "rigid", "plant.ground.friction": question.friction, "name": "limit"} | changes
    )


def _blind(question: Question, walker: str, gait: str, search: Any) -> Answer:
    """The controller walks under the push first; what it has come to by then is where the walk found begins."""
    import casadi as ca

    from controller.limit.solve import answer

    sign = question.what.sign
    low, high = sorted((0.0, sign * 150.0))
    found = None
    for _ in range(ROUNDS):
        forces = np.linspace(low, high, SAMPLES)
        states = [_state_after(question, walker, gait, float(force)) for force in forces]
        known = [(f, x) for f, x in zip(forces, states, strict=True) if x is not None]
        if len(known) < 4:
            raise UserError(
                f"--blind {question.blind:g} s: {question.controller} has left the first step by then at "
                f"{forces[0]:g} to {forces[-1]:g} N; must be shorter"
            )
        middle, scale = float(np.mean([f for f, _ in known])), float(np.ptp([f for f, _ in known])) / 2.0
        scaled = np.array([(f - middle) / scale for f, _ in known])
        table = np.array([x for _, x in known])
        poly = np.polynomial.polynomial.polyfit(scaled, table, 3)
        fit = float(np.abs(np.polynomial.polynomial.polyval(scaled, poly).T - table).max())

        def start(d: Any, poly: Vector = poly, middle: float = middle, scale: float = scale) -> Any:
            x = (d - middle) / scale
            return sum(ca.DM(row) * x**k for k, row in enumerate(poly))

        found = answer(question, search, start)
        width = max(2.0, 0.25 * (high - low))
        low, high = found.motion.disturbance - width / 2.0, found.motion.disturbance + width / 2.0
        found = dataclasses.replace(found, fit=fit)
    assert found is not None
    return found


def _state_after(question: Question, walker: str, gait: str, force: float) -> Vector | None:
    """Link angles and rates (10,) after the blind time; None where the first step is over by then."""
    tape = _States()
    run_scenario(
        _scenario(
            question,
            walker,
            gait,
            **{
                "controller.kind": question.controller,
                "pushes": [{"force": force, "step": 1}],
                "time_limit": question.blind + 2e-3,
            },
        ),
        tape=tape,
        belief=known_belief(walker, gait),
    )
    tick = round(question.blind / 1e-3)
    if len(tape.rows) <= tick or tape.stance[tick] != 0:
        return None
    x = tape.rows[tick]
    return np.concatenate((H @ x[:5], H @ x[5:]))


def _pushed(answer: Answer) -> dict[str, Any]:
    """The push of an answer as settings of a scenario."""
    question = answer.question
    motion, phases = answer.walked
    force = motion.disturbance
    if question.pushed_time is None:
        return {"pushes": [{"force": force, "step": question.step}]}
    start = sum(times_of(motion, phases)[: question.step - 1])
    return {"pushes": [{"force": force, "start": start, "end": start + question.pushed_time}]}


def replay(answer: Answer, walker: str, gait: str) -> dict[str, float]:
    """The walk's torques alone on the rigid plant: by how much it leaves the walk in [rad], at times in [s]."""
    belief = known_belief(walker, gait)
    tape = _States()
    motion, phases = answer.walked
    _run(answer, walker, gait, belief.model, regulate=False, tape=tape)
    found = {}
    for t in CHECKED:
        k = round(t / 1e-3)
        if k < len(tape.rows) and t < sum(motion.times):
            p, _, _, steps = state_at(motion, phases, t)
            leg = Leg.LEFT if steps % 2 == 0 else Leg.RIGHT
            q = leg.from_body(np.linalg.inv(H) @ p)
            found[f"{t:g}"] = round(float(np.abs(tape.rows[k][:5] - q).max()), 5)
    return found


def walk(answer: Answer, walker: str, gait: str, log: Path, plant: str = "rigid") -> RunSummary:
    """Walk the answer on a plant, a regulator holding on to it, into a log.

    Args:
        answer: Of a push.
        walker: Name or folder.
        gait: Name or file.
        log: MCAP file to write.
        plant: "rigid" or "mujoco".

    Raises:
        UserError: the log cannot be written.
    """
    belief = known_belief(walker, gait)
    return _run(answer, walker, gait, belief.model, regulate=True, log=log, plant=plant)


def _run(
    answer: Answer,
    walker: str,
    gait: str,
    model: WalkerModel,
    *,
    regulate: bool,
    tape: _States | None = None,
    log: Path | None = None,
    plant: str = "rigid",
) -> RunSummary:
    from controller.limit.follow import Follower

    follower = Follower(model, *answer.walked, regulate=regulate)
    question = answer.question
    changes: dict[str, Any] = _pushed(answer) if question.what.kind == "push" else {}
    scenario = _scenario(question, walker, gait, **changes)
    changes = {"controller.kind": outside.give(follower), "plant.kind": plant, "description": question.words()}
    return run_scenario(
        with_values(scenario, {"name": f"limit-{question.axis}"} | changes),
        log=log,
        tape=tape,
        belief=known_belief(walker, gait),
        files=ModelFiles.of(scenario),
    )


def fingerprint(walker: str, gait: str) -> str:
    """What tells walkers apart.

    Raises:
        UserError: there is no such walker, or it has no such gait.
    """
    return known_belief(walker, gait).model.fingerprint
