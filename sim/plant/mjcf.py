"""An MJCF of a walker as its file is: read, compiled, refused where a part is missing or not what its name says."""

from pathlib import Path

import mujoco

from sim import mjcf
from sim.errors import UserError
from sim.interface import FEET, JOINTS, LINKS

BASE = ("hip_x", "hip_z", "torso")
"""Joints of the planar base."""

_SLIDE, _HINGE = mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE

_CONTACT = mujoco.mjtSensor.mjSENS_CONTACT


def read_spec(model_path: Path) -> mujoco.MjSpec:
    """An MJCF as it is.

    Raises:
        UserError: missing, not an MJCF, or a link has no mass of its own.
    """
    if not model_path.is_file():
        raise UserError(f"model file {model_path}: does not exist")
    spec = mjcf.read_spec(model_path, f"model file {model_path}")
    for name in LINKS:
        body = spec.body(name)
        if body is not None and not (body.explicitinertial and body.mass > 0.0):
            raise UserError(
                f"model file {model_path}: body {name} has no mass; must have an <inertial> with a mass above 0"
            )
    return spec


def compile_spec(spec: mujoco.MjSpec, model_path: Path) -> mujoco.MjModel:
    """MuJoCo's model of a walker, its parts where they belong.

    Raises:
        UserError: MuJoCo cannot compile it, or a part is missing or not what its name says.
    """
    model = mjcf.compile_spec(spec, f"model file {model_path}")
    slides, hinges = BASE[:2], (BASE[2], *JOINTS)
    for kind, names, words in ((_SLIDE, slides, "a slide"), (_HINGE, hinges, "a hinge")):
        for name in names:
            if model.joint(name).type[0] != kind:
                raise UserError(f"model file {model_path}: joint {name} is none; must be {words}")
    if model.nv != len(BASE) + len(JOINTS):
        legal = ", ".join((*BASE, *JOINTS))
        raise UserError(f"model file {model_path}: {model.nv} degrees of freedom; must be the joints {legal}")
    for name in JOINTS:
        if model.actuator(name).trnid[0] != model.joint(name).id:
            raise UserError(
                f"model file {model_path}: actuator {name} does not drive joint {name}; must be a motor on it"
            )
    for name, size in (*((foot, 13) for foot in FEET), ("torso", 1), ("left_femur", 1), ("right_femur", 1)):
        sensor = next((i for i in range(model.nsensor) if model.sensor(i).name == name), None)
        if sensor is None or model.sensor_type[sensor] != _CONTACT or model.sensor_dim[sensor] < size:
            legal = "found force pos normal tangent" if size > 1 else "found"
            raise UserError(f'model file {model_path}: no contact sensor "{name}" of these data; must have {legal}')
    return model
