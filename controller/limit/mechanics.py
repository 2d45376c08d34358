"""The belief's closed forms written for CasADi, from the same lumped constants; `tests/test_limit.py` compares them.

Link angles phi are ordered as in `controller.belief.kernels`, whose docstring has the equations; here they also bear a
force on the torso, and what acts may be an expression. Everything is in SI units.
"""

from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

from controller.belief import WalkerModel
from controller.belief.kernels import MIRROR, N_Q, N_U, STICK
from controller.belief.lumped import H, lump

Expression = Any
"""A number or vector of CasADi's."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Links:
    """Lumped constants, as `controller.belief.kernels.Walker` has them, numbers or expressions.

    Attributes:
        A, A_impact, A_across, A_impact_across, rotor: (5, 5) in [kg m^2].
        b, b_across: (5,) in [kg m].
        mass: In [kg].
        reach, lever: (5,) in [m], to the swing foot and to the torso's centre of mass.
        across: Of that off the torso's axis in [m].
        damping, friction, stiffness, rest: (4,) of the joints.
        gravity: In [m/s^2].
    """

    A: Expression
    A_impact: Expression
    A_across: Expression
    A_impact_across: Expression
    rotor: Expression
    b: Expression
    b_across: Expression
    mass: Expression
    reach: Any
    lever: Any
    across: float
    damping: Any
    friction: Any
    stiffness: Any
    rest: Any
    gravity: float


_OF_MASS = ("A", "A_impact", "A_across", "A_impact_across", "rotor", "b", "b_across", "mass")


def links_of(model: WalkerModel, torso_factor: Expression = None) -> Links:
    """Constants of a walker.

    Args:
        model: The walker.
        torso_factor: On the torso's mass and inertia; 1 if not given.
    """
    torso, femur, tibia = model.torso, model.femur, model.tibia
    own = model.lumped
    constants: dict[str, Any] = {name: getattr(own, name) for name in _OF_MASS}
    if torso_factor is not None:  # every constant is linear in the masses
        heavy = replace(torso, mass=2.0 * torso.mass, inertia=2.0 * torso.inertia)
        twice = lump(heavy, femur, tibia, model.joints, own.gravity, model.known)
        for name in _OF_MASS:
            more = getattr(twice, name) - getattr(own, name)
            constants[name] = ca.DM(constants[name]) + (torso_factor - 1.0) * ca.DM(more)
    return Links(
        **constants,
        reach=own.reach,
        lever=np.array([-femur.length, 0.0, -tibia.length, 0.0, torso.com]),
        across=torso.com_across if model.known.com_across else 0.0,
        damping=own.damping,
        friction=own.friction,
        stiffness=own.stiffness,
        rest=own.rest,
        gravity=own.gravity,
    )


def to_links(q: Expression) -> Expression:
    """phi = H q, also of rates."""
    return ca.mtimes(ca.DM(H), q)


def from_links(phi: Expression) -> Expression:
    """q = H^-1 phi."""
    return ca.mtimes(ca.DM(np.linalg.inv(H)), phi)


def _differences(phi: Expression) -> tuple[list[list[Expression]], list[list[Expression]]]:
    s, c = [ca.sin(phi[i]) for i in range(N_Q)], [ca.cos(phi[i]) for i in range(N_Q)]
    sine = [[s[i] * c[j] - c[i] * s[j] for j in range(N_Q)] for i in range(N_Q)]
    cosine = [[c[i] * c[j] + s[i] * s[j] for j in range(N_Q)] for i in range(N_Q)]
    return sine, cosine


def inertia(links: Links, phi: Expression) -> list[list[Expression]]:
    """Link inertia matrix, (5, 5)."""
    sine, cosine = _differences(phi)
    return [
        [
            links.A[i, j] * cosine[i][j] + links.A_across[i, j] * sine[i][j] + links.rotor[i, j]
            for j in range(N_Q)
        ]
        for i in range(N_Q)
    ]  # fmt: skip


def bias(links: Links, phi: Expression, dphi: Expression) -> list[Expression]:
    """Link C dphi + G in [N.m], (5,)."""
    sine, cosine = _differences(phi)
    found = []
    for i in range(N_Q):
        value = links.gravity * (links.b_across[i] * ca.cos(phi[i]) - links.b[i] * ca.sin(phi[i]))
        for j in range(N_Q):
            value += (links.A[i, j] * sine[i][j] - links.A_across[i, j] * cosine[i][j]) * dphi[j] ** 2
        found.append(value)
    return found


def link_torques(links: Links, phi: Expression, dphi: Expression, u: Expression) -> list[Expression]:
    """What joint torques do on the links, the joints' resistance taken off, in [N.m], (5,)."""
    q, dq = from_links(phi), from_links(dphi)
    tau = []
    for i in range(N_U):
        value = u[i] - links.damping[i] * dq[i]
        if links.friction[i]:
            value -= links.friction[i] * ca.tanh(dq[i] / STICK)
        if links.stiffness[i]:
            value -= links.stiffness[i] * (q[i] - links.rest[i])
        tau.append(value)
    return [tau[0] - tau[2], tau[1] - tau[3], tau[2], tau[3], -tau[0] - tau[1]]


def torso_jacobian(links: Links, phi: Expression) -> tuple[list[Expression], list[Expression]]:
    """How the torso's centre of mass moves with the links, ahead and up, in [m], (5,) each."""
    ahead = [-links.lever[i] * ca.cos(phi[i]) for i in range(N_Q)]
    up = [-links.lever[i] * ca.sin(phi[i]) for i in range(N_Q)]
    ahead[4] -= links.across * ca.sin(phi[4])
    up[4] += links.across * ca.cos(phi[4])
    return ahead, up


def imbalance(
    links: Links, phi: Expression, dphi: Expression, ddphi: Expression, u: Expression, push: Expression
) -> Expression:
    """Inverse dynamics: what is missing to the equations of motion in [N.m], (5,); zero in a motion.

    Args:
        links: The walker.
        phi: Link angles, (5,).
        dphi: Their rates, (5,).
        ddphi: Their accelerations, (5,).
        u: Joint torques, (4,).
        push: Horizontal force on the torso's centre of mass in [N].
    """
    D, b, x = inertia(links, phi), bias(links, phi, dphi), link_torques(links, phi, dphi, u)
    ahead, _ = torso_jacobian(links, phi)
    return ca.vertcat(
        *(sum(D[i][j] * ddphi[j] for j in range(N_Q)) + b[i] - x[i] - ahead[i] * push for i in range(N_Q))
    )


def stance_force(
    links: Links, phi: Expression, dphi: Expression, ddphi: Expression, push: Expression
) -> tuple[Expression, Expression]:
    """Force on the stance foot, forward and up, in [N]."""
    x, z = -push, links.mass * links.gravity
    for i in range(N_Q):
        s, c, square = ca.sin(phi[i]), ca.cos(phi[i]), dphi[i] ** 2
        x += links.b[i] * (s * square - c * ddphi[i]) - links.b_across[i] * (c * square + s * ddphi[i])
        z -= links.b[i] * (c * square + s * ddphi[i]) + links.b_across[i] * (s * square - c * ddphi[i])
    return x, z


def com_momentum(links: Links, phi: Expression, dphi: Expression) -> tuple[Expression, Expression]:
    """Linear momentum of the pinned walker, forward and up, in [N.s]."""
    x = sum((-links.b[i] * ca.cos(phi[i]) - links.b_across[i] * ca.sin(phi[i])) * dphi[i] for i in range(N_Q))
    z = sum((-links.b[i] * ca.sin(phi[i]) + links.b_across[i] * ca.cos(phi[i])) * dphi[i] for i in range(N_Q))
    return x, z


def swing_foot(links: Links, phi: Expression) -> tuple[Expression, Expression]:
    """Swing foot from the stance foot, ahead and up, in [m]."""
    x = sum(-links.reach[i] * ca.sin(phi[i]) for i in range(N_Q))
    z = sum(links.reach[i] * ca.cos(phi[i]) for i in range(N_Q))
    return x, z


def swing_foot_rate(links: Links, phi: Expression, dphi: Expression) -> tuple[Expression, Expression]:
    """Velocity of the swing foot, ahead and up, in [m/s]."""
    x = sum(-links.reach[i] * ca.cos(phi[i]) * dphi[i] for i in range(N_Q))
    z = sum(-links.reach[i] * ca.sin(phi[i]) * dphi[i] for i in range(N_Q))
    return x, z


def hip_height(links: Links, phi: Expression) -> Expression:
    """Hip above the stance foot in [m]: the lever without the torso."""
    return sum(links.lever[i] * ca.cos(phi[i]) for i in range(N_Q - 1))


def mirrored(phi: Expression) -> Expression:
    """Legs exchanged, (5,)."""
    return ca.vertcat(*(phi[i] for i in MIRROR))


def impact_imbalance(links: Links, phi: Expression, before: Expression, after: Expression) -> Expression:
    """What is missing to the impact in [kg m^2/s], (5,): D(phi) w+ = D_impact(phi) w- about the foot that lands.

    Args:
        links: The walker.
        phi: Link angles at the impact in the order before it.
        before: Rates before it.
        after: Rates after it, in the order after it.
    """
    sine, cosine = _differences(phi)
    momentum = [
        sum(
            (
                links.A_impact[i, j] * cosine[i][j]
                + links.A_impact_across[i, j] * sine[i][j]
                + links.rotor[i, j]
            ) * before[j]
            for j in range(N_Q)
        )
        for i in range(N_Q)
    ]  # fmt: skip
    D = inertia(links, mirrored(phi))
    return ca.vertcat(*(sum(D[i][j] * after[j] for j in range(N_Q)) - momentum[MIRROR[i]] for i in range(N_Q)))
