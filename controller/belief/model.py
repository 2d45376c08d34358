"""The controller's belief about the walker: the analytic model of a URDF."""

import copy
import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin

from controller.belief import kernels, urdf
from controller.belief.lumped import H, Joints, lump
from controller.belief.walker_file import BY_KIND, alike, equal, links_of, per_joint, pinocchio_of
from controller.common.records import Vector
from controller.common.settings import Known

COORDINATES = ("hip_x", "hip_z", "torso", "left_hip", "left_knee", "right_hip", "right_knee")
"""Of the walker that is not pinned, as the plant has them."""

FOOT_FRAMES = ("left_foot", "right_foot")

B = np.vstack([np.eye(4), np.zeros((1, 4))])
"""Input matrix of Eq. (2), (5, 4): torques act on the four joints, not on the torso."""


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
        self.pinocchio = pinocchio_of(root, path)
        self.torso, self.femur, self.tibia = links_of(self.pinocchio, path)
        said = urdf.joints(root, path)

        def of(key: str, what: str, unit: str, *, above: bool = True) -> Vector:
            found = np.array([getattr(said[name], key) for name in BY_KIND])
            return equal(found, path, what, unit, zero=True) if above else alike(found, path, what, unit)

        self.torque_limits = per_joint(self.pinocchio, self.pinocchio.effortLimit, path, "effort limit", "N.m")
        self.joints = Joints(
            damping=per_joint(self.pinocchio, self.pinocchio.damping, path, "damping", "N.m.s/rad", zero=True),
            rotor=of("rotor", "rotor inertia", "kg m^2"),
            friction=of("friction", "dry friction", "N.m"),
            stiffness=of("stiffness", "spring stiffness", "N.m/rad"),
            rest=of("rest", "slack angle of the springs", "rad", above=False),
        )
        for name, rotor in zip(BY_KIND, self.joints.rotor, strict=True):
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
        foot: tuple[float, float, float] = kernels.swing_foot_of(self.lumped, q, dq)
        return foot

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
