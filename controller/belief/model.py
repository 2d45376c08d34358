"""The controller's belief about the walker: a URDF read by Pinocchio, lumped into planar constants.

Derivation of the constants: with the stance foot as origin, the centre of mass of link k is
sum_i lever[k, i] d(phi_i), so that A = lever' m lever + diag(I) and b = lever' m. See `kernels.py` for how they
enter the equations of motion.
"""

import hashlib
from dataclasses import astuple, dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin

from controller.belief import kernels
from controller.errors import UserError
from controller.records import Vector

JOINT_NAMES = ("left_hip", "left_knee", "right_hip", "right_knee")
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
    """

    mass: float
    length: float
    com: float
    inertia: float


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
        damping: Joint damping in [N.m.s/rad], (4,), same order.
    """

    def __init__(self, path: Path, *, gravity: float = 9.81) -> None:
        """Read a URDF.

        Args:
            path: URDF of a planar five-link walker with point feet.
            gravity: Gravitational acceleration in [m/s^2].

        Raises:
            UserError: file missing, unreadable, of another topology, or with impossible numbers.
        """
        self.path = path
        self.pinocchio = load_pinocchio(path)
        self.torso, self.femur, self.tibia = _links(self.pinocchio, path)
        self.torque_limits = _per_joint(self.pinocchio, self.pinocchio.effortLimit, path, "effort limit", "N.m")
        self.damping = _per_joint(self.pinocchio, self.pinocchio.damping, path, "damping", "N.m.s/rad", zero=True)
        self.lumped = lump(self.torso, self.femur, self.tibia, self.damping, gravity)

    @property
    def leg_length(self) -> float:
        """Femur plus tibia in [m]."""
        return self.femur.length + self.tibia.length

    @property
    def fingerprint(self) -> str:
        """Twelve hexadecimal digits that tell walkers apart by what a gait depends on: links and gravity."""
        numbers = [x for link in (self.torso, self.femur, self.tibia) for x in astuple(link)]
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
        D = self.lumped.A * np.cos(difference)
        C = self.lumped.A * np.sin(difference) * dphi[None, :]
        G = -self.lumped.gravity * self.lumped.b * np.sin(phi)
        return StanceDynamics(D=H.T @ D @ H, C=H.T @ C @ H, G=H.T @ G, B=B)

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


def lump(torso: Link, femur: Link, tibia: Link, damping: Vector, gravity: float) -> kernels.Walker:
    """Constants of the pinned walker from its three kinds of link (the legs are alike)."""
    m = np.array([femur.mass, femur.mass, tibia.mass, tibia.mass, torso.mass])
    inertia = np.array([femur.inertia, femur.inertia, tibia.inertia, tibia.inertia, torso.inertia])
    # From the hip: every femur hangs off it, every tibia off the end of its femur.
    from_hip = np.diag([femur.com, femur.com, tibia.com, tibia.com, torso.com])
    from_hip[2, 0] = from_hip[3, 1] = femur.length
    stance_leg = np.array([femur.length, 0.0, tibia.length, 0.0, 0.0])
    swing_leg = np.array([0.0, femur.length, 0.0, tibia.length, 0.0])
    lever = from_hip - stance_leg  # stance foot as origin: hip = -L_f d(phi_0) - L_t d(phi_2)
    lever_next = from_hip - swing_leg  # swing foot as origin, for the impact
    return kernels.Walker(
        A=np.ascontiguousarray(lever.T @ (m[:, None] * lever) + np.diag(inertia)),
        A_impact=np.ascontiguousarray(lever_next.T @ (m[:, None] * lever) + np.diag(inertia)),
        b=lever.T @ m,
        reach=swing_leg - stance_leg,
        damping=np.array(damping, dtype=float),
        mass=float(m.sum()),
        gravity=float(gravity),
    )


def load_pinocchio(path: Path) -> pin.Model:
    """The URDF as an unpinned planar tree: base (PX, PZ, hinge about -y), then the joints of both legs.

    Raises:
        UserError: file missing or not a URDF Pinocchio can read.
    """
    if not path.is_file():
        raise UserError(f"{path}: no such walker file; expected the URDF of a five-link walker")
    base = pin.JointModelComposite(3)
    base.addJoint(pin.JointModelPX())
    base.addJoint(pin.JointModelPZ())
    base.addJoint(pin.JointModelRevoluteUnaligned(*HINGE_AXIS))
    try:
        return pin.buildModelFromUrdf(str(path), base)
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
    com = _along(inertia.lever, path, f"the centre of mass at {name}")
    return Link(mass=float(inertia.mass), length=length, com=com, inertia=about_y)


def _along(translation: Vector, path: Path, what: str) -> float:
    if not np.isfinite(translation).all() or np.abs(translation[:2]).max() > _STRAIGHT or translation[2] <= 0.0:
        raise UserError(f"{path}: {what} is at {translation.tolist()} m; legal: on the link's z axis, above 0 m")
    return float(translation[2])


def _per_joint(model: pin.Model, values: Vector, path: Path, what: str, unit: str, *, zero: bool = False) -> Vector:
    """A joint property ordered (left hip, right hip, left knee, right knee), equal for both legs."""
    names = ("left_hip", "right_hip", "left_knee", "right_knee")
    found = np.array([values[model.joints[model.getJointId(name)].idx_v] for name in names])
    legal = (found >= 0.0).all() if zero else (found > 0.0).all()
    if not (np.isfinite(found).all() and legal):
        raise UserError(
            f"{path}: {what} {found.tolist()} {unit}; legal: finite and {'not below' if zero else 'above'} 0"
        )
    if found[0] != found[1] or found[2] != found[3]:
        raise UserError(f"{path}: {what} {found.tolist()} {unit} differs between the legs")
    return found
