"""Links and joints of the walker, and the planar constants they are lumped into.

Derivation of the constants: with the stance foot as origin, the centre of mass of link k is
sum_i lever[k, i] d(phi_i), so that A = lever' m lever + diag(I) and b = lever' m. A centre of mass off its link's axis
makes the lever complex: with the plane as x + iz, a link's own x axis is -i d(phi), and A is Hermitian. A rotor adds
half its inertia times the square of its joint's rate to the kinetic energy. See `kernels.py` for how all that enters
the equations of motion.
"""

from dataclasses import dataclass, field

import numpy as np

from controller.belief import kernels
from controller.common.products import product
from controller.common.records import Vector
from controller.common.settings import Known

H = np.array(
    [[1, 0, 0, 0, 1], [0, 1, 0, 0, 1], [1, 0, 1, 0, 1], [0, 1, 0, 1, 1], [0, 0, 0, 0, 1]],
    dtype=float,
)
"""phi = H q: absolute angles of (stance femur, swing femur, stance tibia, swing tibia, torso)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Link:
    """One rigid link in the plane.

    Attributes:
        mass: In [kg].
        length: Proximal to distal joint (or foot) in [m]; 0 for the torso, which carries nothing at its end.
        com: Centre of mass from the proximal joint along the link in [m].
        inertia: About the centre of mass in [kg m^2].
        com_across: Centre of mass off the link's axis, along the link's own x, in [m].
    """

    mass: float
    length: float
    com: float
    inertia: float
    com_across: float = 0.0


def _none() -> Vector:
    return np.zeros(4)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Joints:
    """What acts in the joints, (4,) each: both hips, then both knees (the same in stance and body order).

    Attributes:
        damping: In [N.m.s/rad].
        rotor: Rotor inertia as the joints feel it in [kg m^2].
        friction: Dry friction in [N.m].
        stiffness: Of springs in [N.m/rad].
        rest: Angles at which the springs are slack in [rad].
    """

    damping: Vector = field(default_factory=_none)
    rotor: Vector = field(default_factory=_none)
    friction: Vector = field(default_factory=_none)
    stiffness: Vector = field(default_factory=_none)
    rest: Vector = field(default_factory=_none)


def lump(
    torso: Link, femur: Link, tibia: Link, joints: Joints, gravity: float, known: Known | None = None
) -> kernels.Walker:
    """Constants of the pinned walker from its three kinds of link (the legs are alike) and what acts in its joints."""
    known = known or Known()
    m = np.array([femur.mass, femur.mass, tibia.mass, tibia.mass, torso.mass])
    inertia = np.array([femur.inertia, femur.inertia, tibia.inertia, tibia.inertia, torso.inertia])
    # From the hip: every femur hangs off it, every tibia off the end of its femur.
    from_hip = np.diag([femur.com, femur.com, tibia.com, tibia.com, torso.com])
    from_hip[2, 0] = from_hip[3, 1] = femur.length
    stance_leg = np.array([femur.length, 0.0, tibia.length, 0.0, 0.0])
    swing_leg = np.array([0.0, femur.length, 0.0, tibia.length, 0.0])
    lever = from_hip - stance_leg  # stance foot as origin: hip = -L_f d(phi_0) - L_t d(phi_2)
    lever_next = from_hip - swing_leg  # swing foot as origin, for the impact
    own = [femur.com_across, femur.com_across, tibia.com_across, tibia.com_across, torso.com_across]
    # Only a link's own centre of mass can be off its axis: levers are complex, lever - i diag(across).
    across = np.array(own if known.com_across else [0.0] * 5)
    rotor = joints.rotor if known.rotor_inertia else np.zeros(4)
    relative = np.linalg.inv(H)[:4]  # joint angles of link angles
    friction = joints.friction if known.friction else np.zeros(4)
    stiffness = joints.stiffness if known.springs else np.zeros(4)
    weighted, about_own = m[:, None] * lever, np.diag(inertia + m * across * across)
    legs = [1, 0, 2, 3]  # the order in which every log so far has summed
    return kernels.Walker(
        A=product(lever.T, weighted) + about_own,
        A_impact=product(lever_next.T, weighted) + about_own,
        b=product(lever[legs].T, m[legs, None])[:, 0] + m[4] * lever[4],
        reach=swing_leg - stance_leg,
        damping=np.array(joints.damping, dtype=float),
        mass=float(m.sum()),
        gravity=float(gravity),
        extended=bool(across.any() or rotor.any()),
        A_across=np.ascontiguousarray(across[:, None] * weighted - lever.T * (m * across)),
        A_impact_across=np.ascontiguousarray(across[:, None] * weighted - lever_next.T * (m * across)),
        b_across=across * m,
        rotor=product(relative.T, rotor[:, None] * relative),
        resists=bool(friction.any() or stiffness.any()),
        friction=np.array(friction, dtype=float),
        stiffness=np.array(stiffness, dtype=float),
        rest=np.array(joints.rest, dtype=float),
    )
