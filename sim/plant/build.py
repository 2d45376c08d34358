"""From the plant's settings to MuJoCo's model: every setting and modelling error applied to the MJCF."""

import copy
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from sim.errors import UserError
from sim.interface import FEET, JOINTS, LEGS, LINKS
from sim.plant.mjcf import BASE, compile_spec, read_spec
from sim.plant.terrain import Terrain
from sim.scenario import PlantSettings
from sim.scenario.plant import ContactSettings

INTEGRATORS = {
    "implicitfast": mujoco.mjtIntegrator.mjINT_IMPLICITFAST,
    "implicit": mujoco.mjtIntegrator.mjINT_IMPLICIT,
    "RK4": mujoco.mjtIntegrator.mjINT_RK4,
    "Euler": mujoco.mjtIntegrator.mjINT_EULER,
}

CONES = {"elliptic": mujoco.mjtCone.mjCONE_ELLIPTIC, "pyramidal": mujoco.mjtCone.mjCONE_PYRAMIDAL}

_THICKNESS = 2.0  # [m] of the boxes that uneven ground is made of
_WIDTH = 2.0  # [m], across the plane of motion
_COLOURS = ((0.86, 0.87, 0.88, 1.0), (0.78, 0.80, 0.82, 1.0))
_REFSAFE = 2.0  # MuJoCo raises the contact's time constant to this many timesteps without a word

Part = Callable[[str, str], "mujoco.MjsElement"]


def build_spec(settings: PlantSettings, model_path: Path, terrain: Terrain | None = None) -> mujoco.MjSpec:
    """Read the MJCF and apply the plant's settings and modelling errors to it.

    Args:
        settings: Integration, saturation, ground, modelling errors.
        model_path: MJCF file of the walker.
        terrain: Shape of the ground; laid out from the settings with seed 0 if none is given.

    Raises:
        UserError: the file is missing or unreadable, lacks a part of the walker, or a setting is not legal.
    """
    spec = read_spec(model_path)
    if settings.integrator not in INTEGRATORS:
        legal = ", ".join(INTEGRATORS)
        raise UserError(f'plant.integrator = "{settings.integrator}": must be one of {legal}')
    spec.option.timestep = settings.timestep
    spec.option.integrator = INTEGRATORS[settings.integrator]

    def part(kind: str, name: str) -> mujoco.MjsElement:
        found = getattr(spec, kind)(name)
        if found is None:
            raise UserError(f'model file {model_path}: has no {kind} named "{name}"')
        return found

    _set_numerics(settings.contact, spec, part)
    _set_contact(settings, part)
    if settings.ground.is_plane:
        half = settings.ground.slope / 2  # [rad], about (0, -1, 0) as every angle
        part("body", "ground").quat = [math.cos(half), 0.0, -math.sin(half), 0.0]
    else:
        _lay_ground(spec, part, terrain or Terrain(settings.ground, seed=0, length=20.0))
    _set_links(settings, part)
    _set_joints(settings, part)
    return spec


def compiled_model(
    settings: PlantSettings, model_path: Path, terrain: Terrain, *, seed: int, length: float, pictures: bool = False
) -> mujoco.MjModel:
    """A copy of one's own of the model of `build_spec` and `compile_spec`.

    Many runs in a row are of one plant, from one start or another.

    Args:
        settings: Integration, saturation, ground, modelling errors.
        model_path: MJCF file of the walker.
        terrain: Shape of the ground, of these settings.
        seed: That the terrain was laid out with.
        length: The same, in [m].
        pictures: Whether to keep textures, which take ten times as long to compile as all else.

    Raises:
        UserError: the file or a setting is not legal.
    """
    try:
        about = model_path.stat()
    except OSError:
        return compile_spec(build_spec(settings, model_path, terrain), model_path)  # which says what is wrong
    key = (settings, model_path.absolute(), about.st_mtime_ns, about.st_size, seed, length, pictures)
    if key not in _RECENT:
        spec = build_spec(settings, model_path, terrain)
        if not pictures:
            _drop_pictures(spec)
        _RECENT[key] = compile_spec(spec, model_path)
        while len(_RECENT) > MOST_RECENT:
            del _RECENT[next(iter(_RECENT))]
    return copy.copy(_RECENT[key])


def _drop_pictures(spec: mujoco.MjSpec) -> None:
    """Leave textures out: physics sees none of them."""
    for material in spec.materials:
        material.textures = [""] * len(material.textures)
    for texture in list(spec.textures):
        spec.delete(texture)


MOST_RECENT = 4
_RECENT: dict[Any, mujoco.MjModel] = {}


def _set_numerics(contact: ContactSettings, spec: mujoco.MjSpec, part: Part) -> None:
    """Cone, impedance and size of the feet's contact where they are not to be those of the file."""
    if contact.cone != "model":
        spec.option.cone = CONES[contact.cone]
    if contact.impratio is not None:
        spec.option.impratio = contact.impratio
    for name in FEET:
        geom = part("geom", name)
        if contact.time_constant is not None:
            geom.solref = [contact.time_constant, geom.solref[1]]
        if contact.impedance is not None:
            _, most, *rest = geom.solimp
            geom.solimp = [contact.impedance, max(most, contact.impedance), *rest]
        if contact.foot_radius is not None:
            geom.size = [contact.foot_radius, *geom.size[1:]]


def _set_contact(settings: PlantSettings, part: Part) -> None:
    """Friction, and stiffness and damping of the foot's contact.

    MuJoCo's (time constant tc, damping ratio d) mean damping ~ 1/tc and stiffness ~ 1/(tc d)^2.
    """
    ground = settings.ground
    for name in ("floor", *FEET):
        geom = part("geom", name)
        geom.friction = [ground.friction, *geom.friction[1:]]
    for name in FEET:
        geom = part("geom", name)
        time_constant, damping_ratio = geom.solref.tolist()
        time_constant /= ground.damping_factor
        if time_constant < _REFSAFE * settings.timestep:
            most = geom.solref[0] / (_REFSAFE * settings.timestep)
            raise UserError(
                f"plant.ground.damping_factor = {ground.damping_factor:g}: must be at most {most:g} with "
                f"plant.timestep = {settings.timestep:g} s"
            )
        geom.solref = [time_constant, damping_ratio * ground.damping_factor / math.sqrt(ground.stiffness_factor)]


def _lay_ground(spec: mujoco.MjSpec, part: Part, terrain: Terrain) -> None:
    """Replace the plane by one box a facet; the sensors then look at the whole ground body.

    The face of a step is the end of its box. A sphere meets boxes analytically, so nothing but the facets'
    corners differs from a plane.
    """
    floor, foot, ground = part("geom", "floor"), part("geom", FEET[0]), part("body", "ground")
    for number, facet in enumerate(terrain.facets):
        cos, sin = math.cos(facet.angle), math.sin(facet.angle)
        middle = 0.5 * (facet.x0 + facet.x1)
        down = _THICKNESS / 2
        ground.add_geom(
            name=f"floor_{number}",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=[0.5 * (facet.x1 - facet.x0) / cos, _WIDTH / 2, down],
            pos=[middle + down * sin, 0.0, facet.height(middle) - down * cos],
            quat=[math.cos(facet.angle / 2), 0.0, -math.sin(facet.angle / 2), 0.0],
            contype=floor.contype,
            conaffinity=floor.conaffinity,
            condim=foot.condim,
            priority=foot.priority + 1,  # the facet's friction governs, with the foot's stiffness
            friction=[facet.friction, *foot.friction[1:]],
            solref=foot.solref,
            solimp=foot.solimp,
            rgba=_COLOURS[number % 2],
        )
    for sensor in spec.sensors:
        if sensor.objname == floor.name:
            sensor.objtype, sensor.objname = mujoco.mjtObj.mjOBJ_BODY, ground.name
    spec.delete(floor)


def _set_links(settings: PlantSettings, part: Part) -> None:
    """Mass, inertia, centre of mass and length of every link."""
    for name in LINKS:
        body = part("body", name)
        offset = getattr(settings.mass_offset, name)
        factor = getattr(settings.mass_factor, name) + offset / float(body.mass)
        if factor <= 0.0:
            raise UserError(
                f"plant.mass_offset.{name} = {offset:g} kg: must leave a mass above 0; the link has "
                f"{float(body.mass) * getattr(settings.mass_factor, name):g} kg"
            )
        body.mass *= factor
        inertia_factor = getattr(settings.inertia_factor, name)
        body.inertia = body.inertia * ((factor if settings.inertia_follows_mass else 1.0) * inertia_factor)
        across, along = getattr(settings.com_offset_across, name), getattr(settings.com_offset_along, name)
        body.ipos = body.ipos + np.array([across, 0.0, along])
    for leg in LEGS:
        _stretch_femur(leg, getattr(settings.length_factor, f"{leg}_femur"), part)
        _stretch_tibia(leg, getattr(settings.length_factor, f"{leg}_tibia"), part)


def _stretch_femur(leg: str, factor: float, part: Part) -> None:
    _stretch_geom(part("geom", f"{leg}_femur"), factor)
    tibia = part("body", f"{leg}_tibia")
    tibia.pos = tibia.pos * [1.0, 1.0, factor]


def _stretch_tibia(leg: str, factor: float, part: Part) -> None:
    _stretch_geom(part("geom", f"{leg}_tibia"), factor)
    for kind, name in (("geom", f"{leg}_foot"), ("geom", f"{leg}_toe"), ("site", f"{leg}_foot")):
        element = part(kind, name)
        element.pos = element.pos * [1.0, 1.0, factor]


def _stretch_geom(geom: "mujoco.MjsElement", factor: float) -> None:
    geom.fromto = geom.fromto * [1.0, 1.0, factor, 1.0, 1.0, factor]


def _set_joints(settings: PlantSettings, part: Part) -> None:
    """Damping, friction, rotor inertia, spring and stops of every actuated joint; limits of its motor."""
    for name in BASE:
        part("joint", name)
    for name in JOINTS:
        joint, actuator = part("joint", name), part("actuator", name)
        joint.damping = joint.damping * getattr(settings.damping_factor, name)
        joint.frictionloss *= getattr(settings.joint_friction_factor, name)
        joint.frictionloss += getattr(settings.joint_friction, name)
        joint.armature *= getattr(settings.armature_factor, name)
        joint.armature += getattr(settings.armature, name)
        joint.stiffness = joint.stiffness * getattr(settings.stiffness_factor, name)
        if not settings.joint_limits:
            joint.limited = mujoco.mjtLimited.mjLIMITED_FALSE
        factor = getattr(settings.torque_limit_factor, name)
        actuator.forcerange = actuator.forcerange * factor
        actuator.ctrlrange = actuator.ctrlrange * factor
        if not settings.saturation:
            actuator.forcelimited = actuator.ctrllimited = False
