"""Gait optimisation: least cost on the zero dynamics, subject to `requirements.py`.

Invariance and periodicity hold for every vector of `parameters.py`, so what is left is a small smooth problem in
about twenty numbers: the speed as an equation, the margins as inequalities. First the violations alone are made
small (least squares), then SciPy's SLSQP minimises the cost from there. Starts are fixed, so a request has one
answer. Source of the formulation: book, Section 6.6.2.1.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from scipy.optimize import OptimizeResult, least_squares, minimize

from controller.belief import Gait, WalkerModel
from controller.common.errors import UserError
from controller.common.records import Vector
from controller.design.orbit import Orbit, periodic_orbit
from controller.design.parameters import NoPosture, Parametrisation, posture, with_rates
from controller.design.problem import COST, MARGINS, NODES, ROOTS, SPEED, Cost, Problem, violation_of
from controller.design.requirements import Margin, Requirements, margins

COST_UNIT = {"torque": "N^2 m s", "work": "J/m"}
Say = Callable[[str], None]

HELD_BACK = (5e-3, 2e-2)  # scaled margins kept in hand for what happens between the nodes; the second if need be
SLACK = 1e-6  # scaled violation that counts as none
HOPELESS = 0.2  # scaled violation after the approach, above which a start is given up
ROUNDS = 4  # of SLSQP, each with a new metric
ITERATIONS = 60  # of a round
SOFTEST = 0.05  # curvature given to directions that torque does not feel, as a share of the first cost


class Infeasible(UserError):
    """No gait keeps the requirements; the message says which were missed and by how much."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Design:
    """A designed gait.

    Attributes:
        gait: The gait, rates before impact included.
        orbit: Its periodic orbit.
        margins: How it keeps what was asked.
        iterations: SLSQP iterations it took.
    """

    gait: Gait
    orbit: Orbit
    margins: tuple[Margin, ...]
    iterations: int


class _Memory:
    """The last vector evaluated: SciPy asks for cost, equation and inequalities of a point one by one."""

    def __init__(self, f: Callable[[Vector], Vector]) -> None:
        self._f, self._at, self._value = f, np.empty(0), np.empty(0)

    def __call__(self, p: Vector) -> Vector:
        if not np.array_equal(p, self._at):
            self._at, self._value = p.copy(), self._f(p)
        return self._value


def design(
    model: WalkerModel,
    need: Requirements,
    *,
    degree: int = 6,
    cost: Cost = "torque",
    warm: Gait | None = None,
    starts: int = 1,
    say: Say | None = None,
    name: str = "",
) -> Design:
    """The cheapest gait that keeps the requirements.

    Args:
        model: The walker.
        need: What it must keep.
        degree: M of the Bezier polynomials.
        cost: "torque", the integral of squared torque by step length, or "work", that of |torque times rate|.
        warm: Gait to start from first.
        starts: How many starts must lead to a gait; the cheapest is taken. Those that fail do not count.
        say: Told what happens.
        name: Of the gait.

    Raises:
        Infeasible: no start led to a gait that keeps them all.
        UserError: a request that needs no search to be refused.
    """
    _check(model, need, degree)
    say = say or (lambda line: None)
    space = Parametrisation(model=model, degree=degree, step_length=need.step_length)
    feasible: list[Design] = []
    nearest: tuple[float, Vector] | None = None
    tried = 0
    for label, p in _starts(space, need, warm):
        tried += 1
        found, p, violation = _from_start(space, need, cost, p, name)
        if nearest is None or violation < nearest[0]:
            nearest = violation, p
        if found is None:
            say(f"start {tried} ({label}): no gait, scaled violation {violation:.2g}")
            continue
        value = found.orbit.cost if cost == "torque" else found.orbit.work
        say(f"start {tried} ({label}): {found.iterations} iterations, cost {value:.6g} {COST_UNIT[cost]}")
        feasible.append(found)
        if len(feasible) == starts:
            break
    if feasible:
        return min(feasible, key=lambda d: d.orbit.cost if cost == "torque" else d.orbit.work)
    if nearest is None:
        raise Infeasible(
            f"no gait of {need.step_length:g} m for {model.path}: with knees bent as far as they may be the legs "
            "do not reach that far"
        )
    raise Infeasible(_complaint(space, nearest[1], need, tried))


def _from_start(
    space: Parametrisation, need: Requirements, cost: Cost, p: Vector, name: str
) -> tuple[Design | None, Vector, float]:
    """The gait one start leads to, if any; the vector; its largest scaled violation."""
    problem = Problem(space=space, need=need, cost=cost, cost_scale=1.0, held_back=HELD_BACK[0])
    p = _approach(problem, p)
    violation = violation_of(problem.vector(p))
    if violation > HOPELESS:
        return None, p, violation
    first = periodic_orbit(space.model, space.gait(p), NODES)
    scale = max(first.cost if cost == "torque" else first.work, 1e-3)
    iterations = 0
    for held_back in HELD_BACK:
        problem = Problem(space=space, need=need, cost=cost, cost_scale=scale, held_back=held_back)
        p, more = _optimise(problem, p)
        iterations, violation = iterations + more, violation_of(problem.vector(p))
        if violation > SLACK:
            break
        gait, orbit, kept = _finish(space, p, need, name)
        if min(m.worst for m in kept) >= 0.0:
            return Design(gait=gait, orbit=orbit, margins=kept, iterations=iterations), p, violation
    return None, p, violation


def _check(model: WalkerModel, need: Requirements, degree: int) -> None:
    if not 4 <= degree <= 10:
        raise UserError(f"degree = {degree}; must be from 4 to 10")
    for what, value, unit in (("step length", need.step_length, "m"), ("speed", need.speed, "m/s")):
        if not (np.isfinite(value) and value > 0.0):
            raise UserError(f"{what} = {value} {unit}; must be above 0 {unit}")
    reach = 2.0 * model.leg_length
    if need.step_length >= reach:
        raise UserError(
            f"step length = {need.step_length:g} m; must be below {reach:.3g} m, the span of both legs of {model.path}"
        )


def _starts(space: Parametrisation, need: Requirements, warm: Gait | None) -> Iterator[tuple[str, Vector]]:
    """Fixed starts: the warm one, then a plain swing of a bent knee with the torso leaning more or less."""
    if warm is not None:
        yield f"warm, {warm.name}", space.vector(warm)
    for lean, bend, lift in (
        (-0.05, -0.25, -0.45),
        (-0.25, -0.3, -0.6),
        (0.05, -0.15, -0.5),
        (-0.15, -0.4, -0.5),
        (-0.4, -0.2, -0.7),
        (0.0, -0.5, -0.4),
    ):
        p = np.zeros(space.size)
        p[:3] = bend, bend - 0.1, lean
        try:
            last = posture(space.model, bend, bend - 0.1, lean, need.step_length)[:4]
        except NoPosture:
            continue
        first = last[[1, 0, 3, 2]]
        p[3:7] = 0.5 * (last - first)
        for column in range(2, space.degree - 1):
            bump = 4.0 * column / space.degree * (1.0 - column / space.degree)
            at = 7 + 4 * (column - 2)
            p[at : at + 4] = 0.0, -0.5 * lift * bump, 0.1 * bump, lift * bump
        yield f"lean {lean:+.2f} rad, knee {bend:.2f} rad", p


def _approach(problem: Problem, p: Vector) -> Vector:
    """Make the violations small, staying near the start."""
    value, slope = _Memory(problem.vector), _Memory(problem.jacobian)
    stay = 1e-2

    def miss(x: Vector) -> Vector:
        return np.r_[value(x)[SPEED], np.minimum(value(x)[MARGINS] - problem.reserve, 0.0), stay * (x - p)]

    def gradient(x: Vector) -> Vector:
        J = slope(x)
        violated = value(x)[MARGINS] < problem.reserve
        return np.vstack([J[SPEED], J[MARGINS] * violated[:, None], stay * np.eye(p.shape[0])])

    # MINPACK: as good here as the others, and none of its steps is a threaded singular value decomposition.
    return least_squares(miss, p, jac=gradient, method="lm", max_nfev=60, xtol=1e-6, ftol=1e-6).x


def _optimise(problem: Problem, p: Vector) -> tuple[Vector, int]:
    """Rounds of SLSQP in coordinates in which the cost is round.

    SLSQP starts from a unit Hessian and has no trust region: in the raw coordinates its first step leaves every
    gait behind. The cost is a sum of squares, so J'J of its roots is nearly its Hessian, and z = L'(p - p_0) with
    L L' = J'J makes that the unit matrix.
    """
    iterations = 0
    for _ in range(ROUNDS):
        J = problem.jacobian(p)[ROOTS]
        L = np.linalg.cholesky(2.0 * J.T @ J + SOFTEST * np.eye(p.shape[0]))
        metric = np.linalg.inv(L).T
        found = _slsqp(problem, p, metric)
        iterations += int(found.nit)
        candidate = p + metric @ found.x
        gain = _merit(problem, p) - _merit(problem, candidate)
        if gain > 0.0:
            p = candidate
        if gain < 1e-6:
            break
    return p, iterations


def _slsqp(problem: Problem, p: Vector, metric: Vector) -> OptimizeResult:
    value = _Memory(lambda z: problem.vector(p + metric @ z))
    slope = _Memory(lambda z: problem.jacobian(p + metric @ z) @ metric)
    return minimize(
        lambda z: value(z)[COST],
        np.zeros_like(p),
        jac=lambda z: slope(z)[COST],
        constraints=[
            {"type": "eq", "fun": lambda z: value(z)[[SPEED]], "jac": lambda z: slope(z)[[SPEED]]},
            {"type": "ineq", "fun": lambda z: value(z)[MARGINS] - problem.reserve, "jac": lambda z: slope(z)[MARGINS]},
        ],
        method="SLSQP",
        options={"maxiter": ITERATIONS, "ftol": 1e-8},
    )


def _merit(problem: Problem, p: Vector) -> float:
    """Cost with violations priced above anything they could save."""
    vector = problem.vector(p)
    shortfall = max(abs(float(vector[SPEED])), float((problem.reserve - vector[MARGINS]).max()))
    return float(vector[COST]) + 1e3 * max(shortfall, 0.0)


def _finish(space: Parametrisation, p: Vector, need: Requirements, name: str) -> tuple[Gait, Orbit, tuple[Margin, ...]]:
    gait = space.gait(p, name or f"{need.step_length:g}m-{need.speed:g}mps", "designed")
    orbit = periodic_orbit(space.model, gait)
    return with_rates(gait, orbit), orbit, margins(space.model, gait, orbit, need)


def _complaint(space: Parametrisation, p: Vector, need: Requirements, tried: int) -> str:
    request = f"no gait of {need.step_length:g} m at {need.speed:g} m/s for {space.model.path} in {tried} starts"
    try:
        _, orbit, kept = _finish(space, p, need, "")
    except NoPosture as error:
        return f"{request}: {error}"
    missed = [(m.worst / m.scale, m) for m in kept if m.worst < 0.0]
    missed.sort(key=lambda pair: pair[0])
    parts = [f"{m.name} misses by {-m.worst:.3g} {m.unit}".rstrip() + f" (must be {m.legal})" for _, m in missed[:3]]
    if abs(orbit.speed - need.speed) > 1e-3 * need.speed:
        parts.insert(0, f"the nearest one found walks at {orbit.speed:.3g} m/s")
    return f"{request}: " + "; ".join(parts)
