"""A gait on its hybrid zero dynamics: restricted Poincare map, periodic orbit, and everything along it.

On the zero dynamics the outputs vanish and one degree of freedom is left. With sigma = I(theta) dtheta/dt the angular
momentum about the stance foot and zeta = sigma^2 / 2,

    d zeta / d theta = -G_5(theta) I(theta),    V_zero(theta) = integral of G_5 I from theta+,
    sigma+ = delta sigma-  at an impact,        zeta*- = -V_zero(theta-) / (1 - delta^2),

so that the orbit, its time and its stability are quadratures, no differential equation is solved. Source:
E. Westervelt et al., Feedback Control of Dynamic Bipedal Robot Locomotion, CRC Press 2007, Sections 5.4 and 6.2.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from controller.belief import Gait, WalkerModel, kernels
from controller.common.records import Vector
from controller.design import orbit_kernels
from controller.design.orbit_kernels import Nodes

NODES = 49
"""Chebyshev nodes of a step; the integrands are smooth, so quadrature is exact to rounding long before this."""

ZETA_FLOOR = 1e-3
"""Relative to sigma-^2 / 2: below it, the orbit does not exist; the floor keeps what the optimiser sees finite."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Orbit:
    """The periodic orbit of a gait at K nodes from just after an impact to just before the next.

    Attributes:
        s: Normalised clock, (K,), 0 to 1.
        t: Time since the impact in [s], (K,).
        q: Coordinates in [rad], (K, 5), stance order.
        dq: Rates in [rad/s], (K, 5).
        dtheta: Clock rate in [rad/s], (K,).
        u: Torque in [N.m], (K, 4).
        force: Stance force (tangential, normal) in [N], (K, 2).
        foot: Swing foot from the stance foot: x, z in [m], dz/dt in [m/s], (K, 3).
        inertia: I(theta) in [kg m^2], (K,).
        zeta: sigma^2 / 2 in [kg^2 m^4 / s^2], (K,); not above 0 where the walker would stop.
        v_zero: V_zero(theta) in the same unit, (K,).
        delta: sigma+ / sigma- of the impact; delta^2 is the eigenvalue of the restricted Poincare map.
        step_time: In [s].
        step_length: Distance between the feet before the impact in [m].
        cost: Integral of squared torque over the step, by its length, in [N^2 m s].
        work: Integral of |torque times rate| over the step, by its length, in [J/m].
        dq_plus: Rates after the impact in [rad/s], (5,).
        impulse: Impulse on the landing foot (tangential, normal) in [N.s], (2,).
        lift_off: Vertical rate of the old stance foot after the impact in [m/s].
    """

    s: Vector
    t: Vector
    q: Vector
    dq: Vector
    dtheta: Vector
    u: Vector
    force: Vector
    foot: Vector
    inertia: Vector
    zeta: Vector
    v_zero: Vector
    delta: float
    step_time: float
    step_length: float
    cost: float
    work: float
    dq_plus: Vector
    impulse: Vector
    lift_off: float

    @property
    def speed(self) -> float:
        """Mean forward speed in [m/s]."""
        return self.step_length / self.step_time

    @property
    def exists(self) -> bool:
        """Whether the clock runs from start to end: zeta above 0, I without a change of sign, delta^2 below 1."""
        return bool(self.zeta.min() > 0.0 and (self.inertia / self.inertia[-1]).min() > 0.0 and self.delta**2 < 1.0)


@lru_cache(maxsize=8)
def quadrature(n: int) -> tuple[Vector, Vector]:
    """Chebyshev nodes on [0, 1], (n,), and the matrix of integrals from 0 to each of them, (n, n)."""
    x = -np.cos(np.pi * np.arange(n) / (n - 1))
    T = np.polynomial.chebyshev.chebvander(x, n)  # values of T_0 .. T_n
    integrals = np.empty((n, n))
    for k in range(n):
        antiderivative = np.polynomial.chebyshev.chebint(np.eye(n)[k], lbnd=-1.0)
        integrals[:, k] = T[:, : antiderivative.shape[0]] @ antiderivative
    s = 0.5 * (x + 1.0)
    s[0], s[-1] = 0.0, 1.0
    return s, 0.5 * integrals @ np.linalg.inv(T[:, :n])


def periodic_orbit(model: WalkerModel, gait: Gait, n: int = NODES) -> Orbit:
    """The periodic orbit of a gait; `Orbit.exists` says whether there is one.

    Args:
        model: The walker.
        gait: Its outputs; the rates before impact are found here, `gait.dq_minus` is not read.
        n: Nodes.
    """
    walker, table = model.lumped, gait.table
    s, integrals = quadrature(n)
    stage = kernels.new_stage()
    e = np.empty
    nodes = Nodes(e((n, 5)), e((n, 5)), e(n), e(n), e(n), e((n, 5)), e((n, 4)), e((n, 2)), e((n, 3)))
    orbit_kernels.shape(walker, table, s, stage, nodes)
    _, slope_plus, _, _ = orbit_kernels.strike(walker, nodes.q[-1], nodes.slope[-1], stage)
    clock_ratio = float(table.clock @ slope_plus)  # of the clock's rate after and before impact
    delta = float(nodes.inertia[0] * clock_ratio / nodes.inertia[-1])
    span = table.theta_span
    v_zero = span * (integrals @ (nodes.gravity * nodes.inertia))
    zeta_minus = -v_zero[-1] / (1.0 - delta**2)
    zeta = delta**2 * zeta_minus - v_zero
    floor = ZETA_FLOOR * abs(zeta_minus) + 1e-12
    dtheta = np.sqrt(2.0 * np.maximum(zeta, floor)) / np.maximum(np.abs(nodes.inertia), 1e-6)
    orbit_kernels.motion(walker, table, dtheta, stage, nodes)
    t = span * (integrals @ (1.0 / dtheta))
    per_length = span / abs(nodes.foot[-1, 0])
    cost = per_length * float(integrals[-1] @ ((nodes.u**2).sum(1) / dtheta))
    work = per_length * float(integrals[-1] @ (np.abs(nodes.u * nodes.dq[:, :4]).sum(1) / dtheta))
    _, dq_plus, impulse, lift_off = orbit_kernels.strike(walker, nodes.q[-1], nodes.dq[-1], stage)
    return Orbit(
        s=s,
        t=t,
        q=nodes.q,
        dq=nodes.dq,
        dtheta=nodes.dtheta,
        u=nodes.u,
        force=nodes.force,
        foot=nodes.foot,
        inertia=nodes.inertia,
        zeta=zeta,
        v_zero=v_zero,
        delta=delta,
        step_time=float(t[-1]),
        step_length=float(nodes.foot[-1, 0]),
        cost=cost,
        work=work,
        dq_plus=dq_plus,
        impulse=impulse,
        lift_off=float(lift_off),
    )
