"""The walker's URDF as Pinocchio reads it, checked to be that of a planar five-link walker with equal legs."""

from pathlib import Path

import numpy as np
import pinocchio as pin

from controller.belief import urdf
from controller.belief.lumped import Link
from controller.common.errors import UserError
from controller.common.records import Vector

JOINT_NAMES = ("left_hip", "left_knee", "right_hip", "right_knee")
HINGE_AXIS = np.array([0.0, -1.0, 0.0])
_STRAIGHT = 1e-9  # [m] what counts as "on the link's axis"
BY_KIND = ("left_hip", "right_hip", "left_knee", "right_knee")
"""Order of what acts in the joints, in stance and in body order."""


def pinocchio_of(root: "urdf.ET.Element", path: Path) -> pin.Model:
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


def links_of(model: pin.Model, path: Path) -> tuple[Link, Link, Link]:
    """Check the topology and read torso, femur and tibia."""
    joints = tuple(model.names[2:])
    if sorted(joints) != sorted(JOINT_NAMES) or model.nv != 7:
        raise UserError(
            f"{path}: joints {list(joints)} are not those of a five-link walker; must be {list(JOINT_NAMES)}"
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
                f"{path}: the origin of joint {name} is rotated; must be rpy = 0 0 0, which cmpc walker new makes of it"
            )
    torso = _link(model, 1, 0.0, path)
    legs = []
    for side in ("left", "right"):
        hip, knee = model.getJointId(f"{side}_hip"), model.getJointId(f"{side}_knee")
        if np.abs(model.jointPlacements[hip].translation).max() > _STRAIGHT:
            raise UserError(f"{path}: {side}_hip must sit at the torso's origin")
        if not model.existFrame(f"{side}_foot"):
            raise UserError(f"{path}: no frame {side}_foot; must be there, a fixed joint at the tibia's end")
        foot = model.frames[model.getFrameId(f"{side}_foot")].placement.translation
        femur = _link(model, hip, _along(model.jointPlacements[knee].translation, path, f"{side}_knee"), path)
        tibia = _link(model, knee, _along(foot, path, f"{side}_foot"), path)
        legs.append((femur, tibia))
    if legs[0] != legs[1]:
        raise UserError(f"{path}: left and right leg differ; must be equal in masses, lengths and inertias")
    return torso, *legs[0]


def _link(model: pin.Model, joint: int, length: float, path: Path) -> Link:
    inertia = model.inertias[joint]
    name = model.names[joint]
    if not (np.isfinite(inertia.mass) and inertia.mass > 0.0):
        raise UserError(f"{path}: mass of the link at {name} is {inertia.mass} kg; must be above 0 kg")
    about_y = float(inertia.inertia[1, 1])
    if not (np.isfinite(about_y) and about_y > 0.0):
        raise UserError(f"{path}: inertia of the link at {name} is {about_y} kg m^2; must be above 0")
    com, what = inertia.lever, f"the centre of mass at {name}"
    if not np.isfinite(com).all() or abs(com[1]) > _STRAIGHT:
        raise UserError(f"{path}: {what} is at {com.tolist()} m; must be in the plane, y = 0 m")
    across = float(com[0]) if abs(com[0]) > _STRAIGHT else 0.0
    along = float(com[2])
    return Link(mass=float(inertia.mass), length=length, com=along, inertia=about_y, com_across=across)


def _along(translation: Vector, path: Path, what: str) -> float:
    if not np.isfinite(translation).all() or np.abs(translation[:2]).max() > _STRAIGHT or translation[2] <= 0.0:
        raise UserError(f"{path}: {what} is at {translation.tolist()} m; must be on the link's z axis, above 0 m")
    return float(translation[2])


def per_joint(model: pin.Model, values: Vector, path: Path, what: str, unit: str, *, zero: bool = False) -> Vector:
    """A joint property ordered (left hip, right hip, left knee, right knee), equal for both legs."""
    found = np.array([values[model.joints[model.getJointId(name)].idx_v] for name in BY_KIND])
    return equal(found, path, what, unit, zero=zero)


def equal(found: Vector, path: Path, what: str, unit: str, *, zero: bool) -> Vector:
    """A property of `BY_KIND`, (4,), checked to be finite and not below 0 (zero) or above it, equal for both legs."""
    legal = (found >= 0.0).all() if zero else (found > 0.0).all()
    if not (np.isfinite(found).all() and legal):
        raise UserError(
            f"{path}: {what} {found.tolist()} {unit}; must be finite and {'not below' if zero else 'above'} 0"
        )
    return alike(found, path, what, unit)


def alike(found: Vector, path: Path, what: str, unit: str) -> Vector:
    """A property of `BY_KIND`, (4,), checked to be equal for both legs."""
    if found[0] != found[1] or found[2] != found[3]:
        raise UserError(f"{path}: {what} {found.tolist()} {unit} differs between the legs")
    return found
