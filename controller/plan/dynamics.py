"""The pinned walker under a push in absolute link angles, x = (phi, dphi), and the exact derivatives of its motion.

Link angles keep the equations short (see `belief.kernels`), and a planner that gives up the gait's outputs has no use
for theirs.
"""

from typing import NamedTuple

import numpy as np

from controller.belief import kernels
from controller.belief.kernels import Walker
from controller.belief.linalg import cholesky5_solve
from controller.common.compiled import Array, compiled
from controller.ltv.linearisation import by_links

N_X = 10  # link angles and rates
N_U = 4
COLUMNS = N_X + N_U + 1  # derivatives by the state, the torque held, and the time it is held
TIME = N_X + N_U
JOINT_LINKS = ((0, 4), (1, 4), (2, 0), (3, 1))
"""Links whose angles differ by a joint's: q = phi[first] - phi[second]."""


class Terrain(NamedTuple):
    """The ground of a step, a line and perhaps a ledge.

    Attributes:
        tangent: Of its slope, uphill positive.
        level: At the stance foot in [m].
        edge: Where a ledge is, ahead of the stance foot in [m].
        rise: Of the ground there in [m]; 0 without a ledge.
        ramp: Way before it over which the ground rises, for the sake of derivatives, in [m].
    """

    tangent: float = 0.0
    level: float = 0.0
    edge: float = 0.0
    rise: float = 0.0
    ramp: float = 1.0


class World(NamedTuple):
    """What a plan is made for: a walker, what pushes it, and the ground.

    Attributes:
        walker: Lumped constants.
        lever: The push's point of attack as a combination of link directions from the stance foot, in [m], (5,).
        push: Horizontal force there in [N].
        terrain: The ground of this step.
    """

    walker: Walker
    lever: Array
    push: float
    terrain: Terrain


class Rates(NamedTuple):
    """Accelerations and their derivatives at one state.

    Attributes:
        acceleration: Of the links in [rad/s^2], (5,).
        by_x: Derivative, (5, 10).
        by_u: Derivative in [rad/s^2/(N.m)], (5, 4).
        force: The ground's on the stance foot, (tangential, normal) to the horizontal in [N], (2,).
        force_x: Derivative, (2, 10).
        force_u: Derivative in [1/m], (2, 4).
        P, R, D: Scratch of `by_links`, (7, 5).
        column, step: Scratch, (5,), (10,).
    """

    acceleration: Array
    by_x: Array
    by_u: Array
    force: Array
    force_x: Array
    force_u: Array
    P: Array
    R: Array
    D: Array
    column: Array
    step: Array


@compiled
def new_rates() -> Rates:
    """Allocate."""
    e = np.empty
    return Rates(
        e(5), e((5, 10)), e((5, 4)), e(2), e((2, 10)), e((2, 4)), e((7, 5)), e((7, 5)), e((7, 5)), e(5), e(10)
    )  # fmt: skip


@compiled
def place(x: Array, stage: kernels.Stage) -> None:
    """Put the walker into a state."""
    for i in range(5):
        stage.phi[i] = x[i]
        stage.dphi[i] = x[5 + i]
        stage.sin[i] = np.sin(x[i])
        stage.cos[i] = np.cos(x[i])


@compiled
def accelerate(world: World, x: Array, u: Array, stage: kernels.Stage, linearise: bool, out: Rates) -> None:
    """Accelerations and contact force at a state under a torque, and their derivatives if asked for."""
    walker, lever, push = world.walker, world.lever, world.push
    place(x, stage)
    kernels.link_inertia(walker, stage)
    kernels.factor_inertia(stage)
    a = out.acceleration
    for i in range(5):
        a[i] = -stage.bias[i] - push * lever[i] * stage.cos[i]
    for j in range(N_U):
        first, second = JOINT_LINKS[j]
        rate = x[5 + first] - x[5 + second]
        torque = u[j] - walker.damping[j] * rate
        if walker.resists:
            torque -= kernels.resistance(walker, j, x[first] - x[second], rate)
        a[first] += torque
        a[second] -= torque
    cholesky5_solve(stage.L, a)
    for i in range(5):
        stage.ddphi[i] = a[i]
    kernels.stance_force(walker, stage, out.force)
    out.force[0] -= push
    if not linearise:
        return
    P, R, D = out.P, out.R, out.D
    by_links(walker, stage, P, R, D)
    for i in range(5):
        P[i, i] -= push * lever[i] * stage.sin[i]
    for j in range(N_U):
        first, second = JOINT_LINKS[j]
        per_rate, per_angle = walker.damping[j], 0.0
        if walker.resists:
            friction, per_angle = kernels.resistance_slopes(walker, j, x[5 + first] - x[5 + second])
            per_rate += friction
        for M, v in ((R, per_rate), (P, per_angle)):
            M[first, first] += v
            M[first, second] -= v
            M[second, first] -= v
            M[second, second] += v
    column = out.column
    for m in range(N_X + N_U):
        if m < 5:
            for i in range(5):
                column[i] = -P[i, m]
        elif m < N_X:
            for i in range(5):
                column[i] = -R[i, m - 5]
        else:
            for i in range(5):
                column[i] = 0.0
            first, second = JOINT_LINKS[m - N_X]
            column[first] = 1.0
            column[second] = -1.0
        cholesky5_solve(stage.L, column)
        for row in range(2):
            v = 0.0
            for i in range(5):
                v += D[5 + row, i] * column[i]
            if m < 5:
                out.force_x[row, m] = v + P[5 + row, m]
            elif m < N_X:
                out.force_x[row, m] = v + R[5 + row, m - 5]
            else:
                out.force_u[row, m - N_X] = v
        if m < N_X:
            for i in range(5):
                out.by_x[i, m] = column[i]
        else:
            for i in range(5):
                out.by_u[i, m - N_X] = column[i]


@compiled
def stance_force(world: World, x: Array, u: Array) -> Array:
    """The ground's force on the stance foot, (tangential, normal) to the horizontal in [N], (2,)."""
    rates = new_rates()
    accelerate(world, x, u, kernels.new_stage(), False, rates)
    return rates.force


@compiled
def advance(world: World, u: Array, h: float, stage: kernels.Stage, start: Rates, rest: Rates, x: Array) -> None:
    """One step of the classical Runge-Kutta method under a held torque, in place.

    Args:
        world: Walker, push and ground.
        u: Torque in [N.m], (4,).
        h: Time in [s].
        stage: Scratch.
        start: Filled: accelerations and force at the beginning.
        rest: Scratch.
        x: State, (10,); h later afterwards.
    """
    total, now = np.zeros(N_X), x.copy()
    for number in range(4):
        rates = start if number == 0 else rest
        accelerate(world, now, u, stage, False, rates)
        share = 2.0 if number in (1, 2) else 1.0
        ahead = h if number == 2 else 0.5 * h
        for i in range(5):
            speed, acceleration = now[5 + i], rates.acceleration[i]
            total[i] += share * speed
            total[5 + i] += share * acceleration
            now[i] = x[i] + ahead * speed
            now[5 + i] = x[5 + i] + ahead * acceleration
    for i in range(N_X):
        x[i] += h / 6.0 * total[i]


@compiled
def advance_tangent(
    world: World, u: Array, h: float, per_time: float, stage: kernels.Stage, start: Rates, rest: Rates, x: Array,
    S: Array,
) -> None:  # fmt: skip
    """`advance` with its derivative applied to S (10, 15) from the left.

    Args:
        world: Walker, push and ground.
        u: Torque in [N.m], (4,).
        h: Time in [s].
        per_time: Derivative of h by the time of the last column of S.
        stage: Scratch.
        start: Filled: accelerations and force at the beginning, with their derivatives.
        rest: Scratch.
        x: State, (10,); h later afterwards.
        S: Derivatives of the state, (10, 15); h later afterwards.
    """
    total, now = np.zeros(N_X), x.copy()
    tangent, slope, total_S = S.copy(), np.empty((N_X, COLUMNS)), np.zeros((N_X, COLUMNS))
    for number in range(4):
        rates = start if number == 0 else rest
        accelerate(world, now, u, stage, True, rates)
        for i in range(5):
            low, row = slope[i], slope[5 + i]
            for m in range(COLUMNS):
                low[m] = tangent[5 + i, m]
                row[m] = 0.0
            for j in range(N_X):
                v = rates.by_x[i, j]
                for m in range(COLUMNS):
                    row[m] += v * tangent[j, m]
            for j in range(N_U):
                row[N_X + j] += rates.by_u[i, j]
        share = 2.0 if number in (1, 2) else 1.0
        part = 1.0 if number == 2 else 0.5
        for i in range(N_X):
            speed = now[5 + i] if i < 5 else rates.acceleration[i - 5]
            total[i] += share * speed
            for m in range(COLUMNS):
                total_S[i, m] += share * slope[i, m]
                tangent[i, m] = S[i, m] + part * h * slope[i, m]
            tangent[i, TIME] += part * per_time * speed
            rest.step[i] = x[i] + part * h * speed
        for i in range(N_X):
            now[i] = rest.step[i]
    for i in range(N_X):
        x[i] += h / 6.0 * total[i]
        for m in range(COLUMNS):
            S[i, m] += h / 6.0 * total_S[i, m]
        S[i, TIME] += per_time / 6.0 * total[i]


@compiled
def strike(walker: Walker, x: Array, stage: kernels.Stage, linearise: bool, J: Array, out: Array) -> None:
    """Rigid impact and leg exchange, x+ = Delta(x-), Eq. (3), with its derivative J (10, 10)."""
    place(x, stage)
    momentum = np.zeros(5)
    by_x = np.zeros((N_X, 5))  # a row a column of x
    for i in range(5):
        row = kernels.MIRROR[i]
        for k in range(5):
            a = walker.A_impact[i, k]
            cosine = a * (stage.cos[i] * stage.cos[k] + stage.sin[i] * stage.sin[k])
            sine = a * (stage.sin[i] * stage.cos[k] - stage.cos[i] * stage.sin[k])
            rotor = 0.0
            if walker.extended:
                across = walker.A_impact_across[i, k]
                cosine += across * (stage.sin[i] * stage.cos[k] - stage.cos[i] * stage.sin[k])
                sine -= across * (stage.cos[i] * stage.cos[k] + stage.sin[i] * stage.sin[k])
                rotor = walker.rotor[i, k]
            momentum[row] += (cosine + rotor) * stage.dphi[k]
            if linearise:
                by_phi = sine * stage.dphi[k] if k != i else 0.0
                by_x[k, row] += by_phi
                by_x[i, row] -= by_phi
                by_x[5 + k, row] += cosine + rotor
    for i in range(5):
        out[kernels.MIRROR[i]] = x[i]
        out[5 + i] = 0.0
    place(out, stage)
    kernels.link_inertia(walker, stage)
    kernels.factor_inertia(stage)
    cholesky5_solve(stage.L, momentum)
    for i in range(5):
        out[5 + i] = momentum[i]
    if not linearise:
        return
    J[:] = 0.0
    for i in range(5):
        for k in range(5):
            if k != i:
                sine = walker.A[i, k] * (stage.sin[i] * stage.cos[k] - stage.cos[i] * stage.sin[k])
                if walker.extended:
                    sine -= walker.A_across[i, k] * (stage.cos[i] * stage.cos[k] + stage.sin[i] * stage.sin[k])
                by_x[kernels.MIRROR[k], i] -= sine * momentum[k]
                by_x[kernels.MIRROR[i], i] += sine * momentum[k]
        J[kernels.MIRROR[i], i] = 1.0
    for m in range(N_X):
        cholesky5_solve(stage.L, by_x[m])
        for i in range(5):
            J[5 + i, m] = by_x[m, i]
