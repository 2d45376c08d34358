"""The controller's belief about the walker: a URDF read by Pinocchio, lumped into planar constants.

Derivation of the constants: with the stance foot as origin, the centre of mass of link k is
sum_i lever[k, i] d(phi_i), so that A = lever' m lever + diag(I) and b = lever' m. A centre of mass off its link's axis
makes the lever complex: with the plane as x + iz, a link's own x axis is -i d(phi), and A is Hermitian. A rotor adds
half its inertia times the square of its joint's rate to the kinetic energy. See `kernels.py` for how all that enters
the equations of motion.
"""

import copy
import hashlib
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pinocchio as pin

from controller.belief import kernels, urdf
from controller.errors import UserError
from controller.products import product
from controller.records import Vector
from controller.settings import Known

JOINT_NAMES = ("left_hip", "left_knee", "right_hip", "right_knee")
COORDINATES = ("hip_x", "hip_z", "torso", "left_hip", "left_knee", "right_hip", "right_knee")
"""Of the walker that is not pinned, as the plant has them."""

FOOT_FRAMES = ("left_foot", "right_foot")
HINGE_AXIS = np.array([0.0, -1.0, 0.0])
_STRAIGHT = 1e-9  # [m] what counts as "on the link's axis"

H = np.array(
    [[1, 0, 0, 0, 1], [0, 1, 0, 0, 1], [1, 0, 1, 0, 1], [0, 1, 0, 1, 1], [0, 0, 0, 0, 1]],
    dtype=float,
)
"""phi = H q: absolute angles of (stance femur, swing femur, stance tibia, swing tibia, torso)."""

B = np.vstack([np.eye(4), np.zeros((1, 4))])
"""Input matrix of Eq. (2), (5, 4): torques act on the four joints, not on the torso."""


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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StanceDynamics:
    """Matrices of Eq. (2) at one state.

    Attributes:
        D: Mass-inertia matrix, (5, 5).
        C: Coriolis matrix, (5, 5), with dD/dt - 2 C skew-symmetric.
        G: Gravity vector in [N.m], (5,).
        B: Input matrix, (5, 4).
    """

    D: Vector
    C: Vector
    G: Vector
    B: Vector


class WalkerModel:
    """Analytic five-link walker, pinned at its stance foot.

    Attributes:
        path: URDF the model came from.
        torso, femur, tibia: The links.
        lumped: Constants of the compiled arithmetic.
        torque_limits: In [N.m], (4,): both hips, then both knees (the same in stance and body order).
        joints: What else acts in the joints, all that the file says.
        low, high: Joint stops in [rad], (4,), same order; infinite where there is none.
        known: What of it the arithmetic knows.
    """

    def __init__(self, path: Path, *, gravity: float = 9.81, known: Known | None = None) -> None:
        """Read a URDF.

        Args:
            path: URDF of a planar five-link walker with point feet.
            gravity: Gravitational acceleration in [m/s^2].
            known: What the controller knows; all but friction if not given.

        Raises:
            UserError: file missing, unreadable, of another topology, or with impossible numbers.
        """
        self.path = path
        self.known = known = known or Known()
        root = urdf.parse(path)
        self.pinocchio = _pinocchio(root, path)
        self.torso, self.femur, self.tibia = _links(self.pinocchio, path)
        said = urdf.joints(root, path)

        def of(key: str, what: str, unit: str, *, above: bool = True) -> Vector:
            found = np.array([getattr(said[name], key) for name in _BY_KIND])
            return _equal(found, path, what, unit, zero=True) if above else _alike(found, path, what, unit)

        self.torque_limits = _per_joint(self.pinocchio, self.pinocchio.effortLimit, path, "effort limit", "N.m")
        self.joints = Joints(
            damping=_per_joint(self.pinocchio, self.pinocchio.damping, path, "damping", "N.m.s/rad", zero=True),
            rotor=of("rotor", "rotor inertia", "kg m^2"),
            friction=of("friction", "dry friction", "N.m"),
            stiffness=of("stiffness", "spring stiffness", "N.m/rad"),
            rest=of("rest", "slack angle of the springs", "rad", above=False),
        )
        for name, rotor in zip(_BY_KIND, self.joints.rotor, strict=True):
            self.pinocchio.armature[self.pinocchio.joints[self.pinocchio.getJointId(name)].idx_v] = rotor
        self.low = of("low", "lower limit", "rad", above=False)
        self.high = of("high", "upper limit", "rad", above=False)
        self.lumped = lump(self.torso, self.femur, self.tibia, self.joints, gravity, known)

    def knowing(self, known: Known) -> "WalkerModel":
        """The same walker as another controller knows it."""
        if known == self.known:
            return self
        other = copy.copy(self)
        other.known = known
        other.lumped = lump(self.torso, self.femur, self.tibia, self.joints, self.lumped.gravity, known)
        return other

    @property
    def damping(self) -> Vector:
        """Joint damping in [N.m.s/rad], (4,): both hips, then both knees."""
        return self.joints.damping

    @property
    def leg_length(self) -> float:
        """Femur plus tibia in [m]."""
        return self.femur.length + self.tibia.length

    @property
    def fingerprint(self) -> str:
        """Twelve hexadecimal digits that tell walkers apart by what a gait depends on: links, rotors and gravity."""
        links = (self.torso, self.femur, self.tibia)
        numbers = [x for link in links for x in (link.mass, link.length, link.com, link.inertia)]
        more = [*(link.com_across for link in links), *self.joints.rotor]
        numbers += more if any(more) else []
        text = " ".join(f"{x:.9g}" for x in (*numbers, self.lumped.gravity))
        return hashlib.sha256(text.encode()).hexdigest()[:12]

    def dynamics(self, q: Vector, dq: Vector) -> StanceDynamics:
        """D, C, G and B of the stance dynamics.

        Implements: Eqs. (1)-(2).

        Args:
            q: Coordinates in [rad], (5,).
            dq: Rates in [rad/s], (5,).
        """
        phi, dphi = H @ q, H @ dq
        difference = phi[:, None] - phi[None, :]
        walker, cosine, sine = self.lumped, np.cos(difference), np.sin(difference)
        D = walker.A * cosine + walker.A_across * sine + walker.rotor
        C = (walker.A * sine - walker.A_across * cosine) * dphi[None, :]
        G = walker.gravity * (walker.b_across * np.cos(phi) - walker.b * np.sin(phi))
        return StanceDynamics(D=H.T @ D @ H, C=H.T @ C @ H, G=H.T @ G, B=B)

    def unpinned(self, q: Vector, dq: Vector) -> tuple[Vector, Vector, Vector]:
        """The whole walker free of the ground, as the file says it is, by Pinocchio.

        Args:
            q: Hip x, z in [m], torso, left hip, left knee, right hip, right knee in [rad], (7,): `COORDINATES`.
            dq: Their rates, (7,).

        Returns:
            Mass matrix, rotors included, (7, 7); Coriolis, centrifugal and gravity terms in [N], [N.m], (7,); tips of
            the left and right tibia (x, z) in [m], (2, 2).
        """
        belief = self.pinocchio
        data = belief.createData()
        order = [0, 1, 2, *(belief.joints[belief.getJointId(name)].idx_v for name in COORDINATES[3:])]
        x, dx = np.empty(7), np.empty(7)
        x[order], dx[order] = q, dq
        D = pin.crba(belief, data, x)
        D = (np.triu(D) + np.triu(D, 1).T)[np.ix_(order, order)]
        bias = pin.nonLinearEffects(belief, data, x, dx)[order]
        pin.framesForwardKinematics(belief, data, x)
        feet = np.array([data.oMf[belief.getFrameId(name)].translation[[0, 2]] for name in FOOT_FRAMES])
        return D, bias, feet

    def acceleration(self, q: Vector, dq: Vector, u: Vector) -> Vector:
        """Acceleration of the pinned walker under torque u, joint damping included, in [rad/s^2], (5,)."""
        stage = kernels.new_stage()
        kernels.place(q, dq, stage)
        kernels.accelerate(self.lumped, dq, u, stage)
        return stage.ddq

    def stance_force(self, q: Vector, dq: Vector, u: Vector) -> tuple[Vector, Vector]:
        """Stance contact force and its change per torque.

        Implements: Eqs. (18), (20).

        Args:
            q: Coordinates in [rad], (5,).
            dq: Rates in [rad/s], (5,).
            u: Torque in [N.m], (4,), stance order.

        Returns:
            (tangential, normal) in [N], (2,), and dF/du = -S_MPC in [1/m], (2, 4).
        """
        stage = kernels.new_stage()
        kernels.place(q, dq, stage)
        kernels.accelerate(self.lumped, dq, u, stage)
        kernels.responses(stage)
        force, per_torque = np.empty(2), np.empty((2, 4))
        kernels.stance_force(self.lumped, stage, force)
        kernels.stance_force_per_torque(self.lumped, stage, per_torque)
        return force, per_torque

    def swing_foot(self, q: Vector, dq: Vector) -> tuple[float, float, float]:
        """Swing foot from the stance foot: (p_2^h, p_2^v) in [m] and the rate of p_2^v in [m/s]; Eq. (4)."""
        stage = kernels.new_stage()
        kernels.place(q, dq, stage)
        return kernels.swing_foot(self.lumped, stage)

    def impact(self, q: Vector, dq: Vector) -> tuple[Vector, Vector]:
        """State after the rigid impact, relabelled so that the landed leg is the stance leg.

        Implements: Eq. (3).

        Args:
            q: Coordinates before impact in [rad], (5,).
            dq: Rates before impact in [rad/s], (5,).

        Returns:
            q+ in [rad] and dq+ in [rad/s], (5,) each.
        """
        q_plus, dq_plus = np.array(q, dtype=float), np.array(dq, dtype=float)
        stage = kernels.new_stage()
        kernels.place(q_plus, dq_plus, stage)
        kernels.impact(self.lumped, q_plus, dq_plus, stage)
        return q_plus, dq_plus


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


def _pinocchio(root: "urdf.ET.Element", path: Path) -> pin.Model:
    """The URDF as an unpinned planar tree: base (PX, PZ, hinge about -y), then the joints of both legs.

    Raises:
        UserError: not a URDF Pinocchio can read.
    """
    base = pin.JointModelComposite(3)
    base.addJoint(pin.JointModelPX())
    base.addJoint(pin.JointModelPZ())
    base.addJoint(pin.JointModelRevoluteUnaligned(*HINGE_AXIS))
    return read_pinocchio(root, base, path)


def read_pinocchio(root: "urdf.ET.Element", base: pin.JointModel, path: Path) -> pin.Model:
    """A URDF on a base; whatever its parser prints is kept off the terminal.

    Raises:
        UserError: not a URDF Pinocchio can read.
    """
    try:
        with urdf.silent():
            return pin.buildModelFromXML(urdf.bare(root), base)
    except (ValueError, RuntimeError, IndexError) as error:
        reason = str(error).strip().splitlines()[0] if str(error).strip() else "unreadable"
        raise UserError(f"{path}: not a URDF Pinocchio can read ({reason})") from error


def _links(model: pin.Model, path: Path) -> tuple[Link, Link, Link]:
    """Check the topology and read torso, femur and tibia."""
    joints = tuple(model.names[2:])
    if sorted(joints) != sorted(JOINT_NAMES) or model.nv != 7:
        raise UserError(
            f"{path}: joints {list(joints)} are not those of a five-link walker; legal: {list(JOINT_NAMES)}"
        )
    parents = {name: model.names[model.parents[model.getJointId(name)]] for name in JOINT_NAMES}
    base = model.names[1]
    for side in ("left", "right"):
        if parents[f"{side}_hip"] != base or parents[f"{side}_knee"] != f"{side}_hip":
            raise UserError(f"{path}: {side} leg is not torso - {side}_hip - {side}_knee")
    for name in JOINT_NAMES:
        joint = model.joints[model.getJointId(name)]
        data = joint.createData()
        joint.calc(data, np.zeros(joint.nq))
        S = np.array(data.S if not callable(data.S) else data.S())
        if joint.nv != 1 or not np.allclose(S.reshape(-1, 6)[0], np.r_[0, 0, 0, HINGE_AXIS]):
            raise UserError(f"{path}: joint {name} must be a hinge about axis (0, -1, 0)")
        turned = model.jointPlacements[model.getJointId(name)].rotation
        if np.abs(turned - np.eye(3)).max() > _STRAIGHT:
            raise UserError(
                f"{path}: the origin of joint {name} is rotated; legal: rpy = 0 0 0, which cmpc walker new makes of it"
            )
    torso = _link(model, 1, 0.0, path)
    legs = []
    for side in ("left", "right"):
        hip, knee = model.getJointId(f"{side}_hip"), model.getJointId(f"{side}_knee")
        if np.abs(model.jointPlacements[hip].translation).max() > _STRAIGHT:
            raise UserError(f"{path}: {side}_hip must sit at the torso's origin")
        if not model.existFrame(f"{side}_foot"):
            raise UserError(f"{path}: no frame {side}_foot; legal: a fixed joint at the tibia's end")
        foot = model.frames[model.getFrameId(f"{side}_foot")].placement.translation
        femur = _link(model, hip, _along(model.jointPlacements[knee].translation, path, f"{side}_knee"), path)
        tibia = _link(model, knee, _along(foot, path, f"{side}_foot"), path)
        legs.append((femur, tibia))
    if legs[0] != legs[1]:
        raise UserError(f"{path}: left and right leg differ; legal: equal masses, lengths and inertias")
    return torso, *legs[0]


def _link(model: pin.Model, joint: int, length: float, path: Path) -> Link:
    inertia = model.inertias[joint]
    name = model.names[joint]
    if not (np.isfinite(inertia.mass) and inertia.mass > 0.0):
        raise UserError(f"{path}: mass of the link at {name} is {inertia.mass} kg; legal: above 0 kg")
    about_y = float(inertia.inertia[1, 1])
    if not (np.isfinite(about_y) and about_y > 0.0):
        raise UserError(f"{path}: inertia of the link at {name} is {about_y} kg m^2; legal: above 0")
    com, what = inertia.lever, f"the centre of mass at {name}"
    if not np.isfinite(com).all() or abs(com[1]) > _STRAIGHT:
        raise UserError(f"{path}: {what} is at {com.tolist()} m; legal: in the plane, y = 0 m")
    across = float(com[0]) if abs(com[0]) > _STRAIGHT else 0.0
    along = float(com[2])
    return Link(mass=float(inertia.mass), length=length, com=along, inertia=about_y, com_across=across)


def _along(translation: Vector, path: Path, what: str) -> float:
    if not np.isfinite(translation).all() or np.abs(translation[:2]).max() > _STRAIGHT or translation[2] <= 0.0:
        raise UserError(f"{path}: {what} is at {translation.tolist()} m; legal: on the link's z axis, above 0 m")
    return float(translation[2])


_BY_KIND = ("left_hip", "right_hip", "left_knee", "right_knee")


def _per_joint(model: pin.Model, values: Vector, path: Path, what: str, unit: str, *, zero: bool = False) -> Vector:
    """A joint property ordered (left hip, right hip, left knee, right knee), equal for both legs."""
    found = np.array([values[model.joints[model.getJointId(name)].idx_v] for name in _BY_KIND])
    return _equal(found, path, what, unit, zero=zero)


def _equal(found: Vector, path: Path, what: str, unit: str, *, zero: bool) -> Vector:
    legal = (found >= 0.0).all() if zero else (found > 0.0).all()
    if not (np.isfinite(found).all() and legal):
        raise UserError(
            f"{path}: {what} {found.tolist()} {unit}; legal: finite and {'not below' if zero else 'above'} 0"
        )
    return _alike(found, path, what, unit)


def _alike(found: Vector, path: Path, what: str, unit: str) -> Vector:
    if found[0] != found[1] or found[2] != found[3]:
        raise UserError(f"{path}: {what} {found.tolist()} {unit} differs between the legs")
    return found
