"""An MJCF as a tree of links, and as MuJoCo has it: classes, defaults and autolimits are MuJoCo's own to resolve."""

import math
import xml.etree.ElementTree as ET
from pathlib import Path

import mujoco
import numpy as np

from sim import mjcf
from sim.errors import UserError
from sim.walkers.tree import FULL_TURN, Array, Inertial, Joint, Kind, Link, Row, Tip, Tree, at, placed
from sim.walkers.urdf import name_of_foot

KINDS: dict[int, Kind] = {
    mujoco.mjtJoint.mjJNT_HINGE: "hinge",
    mujoco.mjtJoint.mjJNT_SLIDE: "slide",
    mujoco.mjtJoint.mjJNT_FREE: "free",
}
DEEPEST = 8  # includes
GRAVITY = 9.81  # [m/s^2] of every plant here


def read(path: Path) -> Tree:
    """An MJCF as a tree.

    Raises:
        UserError: missing, not an MJCF MuJoCo can compile, or with a joint of a kind that is none of a walker's.
    """
    spec, rows = bare(path)
    model = mjcf.compile_spec(spec, str(path))
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    motors = _motors(model, rows)
    links = [Link(name="world", parent=None, placement=np.eye(4))]
    last = {0: "world"}  # of each body's chain of joints
    for body in range(1, model.nbody):
        links += _body(model, body, last, motors, path)
    gravity = model.opt.gravity
    if abs(gravity[2] + GRAVITY) > 1e-9 or gravity[:2].any():
        found = " ".join(f"{x:g}" for x in gravity) + " m/s^2"
        rows.append(Row(part="gravity", found=found, made=f"0 0 {-GRAVITY:g} m/s^2", verdict="left out"))
    named = [("integrator, timestep, solver", f"timestep {model.opt.timestep:g} s")]
    rows += [Row(part=a, found=b, made="set by plant.timestep and its like", verdict="left out") for a, b in named]
    for what, count in (("equality constraints", model.neq), ("tendons", model.ntendon)):
        if count:
            rows.append(Row(part=what, found=f"{count}", made="a tree of five links alone", verdict="outside"))
    return Tree(links=links, rows=rows)


def bare(path: Path) -> tuple[mujoco.MjSpec, list[Row]]:
    """The file without meshes, textures and what else lies in other files.

    Raises:
        UserError: missing, not an MJCF, or not in UTF-8.
    """
    if not path.is_file():
        raise UserError(f"{path}: no such file; expected an MJCF")
    spec = mjcf.read_spec(path, str(path))
    whole(path)  # names that are not UTF-8 MuJoCo reads, but cannot hand over
    rows = []
    meshes = [geom for geom in spec.geoms if geom.type == mujoco.mjtGeom.mjGEOM_MESH]
    for geom in meshes:
        owner = geom.parent
        if owner.name != "world" and not owner.explicitinertial:
            where = f"body {owner.name}"
            rows.append(
                Row(part=where, found="mass of a mesh", made="an <inertial> of numbers", verdict="must be given")
            )
        spec.delete(geom)
    if meshes:
        rows.append(Row(part="meshes", found=f"{len(meshes)}", made="not looked at", verdict="left out"))
    for item in [*spec.meshes, *spec.hfields, *spec.skins, *spec.keys]:
        spec.delete(item)
    for texture in list(spec.textures):
        if texture.file or any(texture.cubefiles):
            spec.delete(texture)
    return spec, rows


def whole(path: Path) -> str:
    """The file's text, what it includes in its place.

    Raises:
        UserError: it, or a file that it includes, is missing, no text in UTF-8 or not XML.
    """
    text = _text(path)
    return ET.tostring(_root(path, path.parent, 0), encoding="unicode") if "<include" in text else text


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise UserError(f"{path}: cannot be read ({error}); must be an MJCF in UTF-8") from error


def _root(path: Path, main: Path, depth: int) -> ET.Element:
    """A file's root element; what it includes lies in the main file's folder, or else in its own, as for MuJoCo."""
    if depth > DEEPEST:
        raise UserError(f"{path}: includes nested more than {DEEPEST} deep")
    try:
        root = ET.fromstring(_text(path))
    except ET.ParseError as error:
        raise UserError(f"{path}: not an XML file ({error})") from error
    for parent in list(root.iter()):
        for place, item in reversed(list(enumerate(parent))):
            if item.tag == "include":
                parent.remove(item)
                name = item.get("file", "")
                inner = _root((main if (main / name).is_file() else path.parent) / name, main, depth + 1)
                for child in reversed(list(inner)):
                    parent.insert(place, child)
    return root


def _body(model: mujoco.MjModel, body: int, last: dict[int, str], motors: dict[int, float], path: Path) -> list[Link]:
    """A body's joints one after the other, its mass on the last."""
    name = model.body(body).name or f"body {body}"
    turn = np.empty(9)
    mujoco.mju_quat2Mat(turn, model.body_quat[body])
    placement = placed(turn.reshape(3, 3), model.body_pos[body])
    parent = last[int(model.body_parentid[body])]
    first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
    links = []
    for j in range(first, first + count) if count else ():
        end = j == first + count - 1
        link = Link(name=name if end else f"{name}:{j}", parent=parent, placement=placement)
        link.joint = _joint(model, j, motors, path)
        links.append(link)
        parent, placement = link.name, np.eye(4)
    if not count:
        links.append(Link(name=name, parent=parent, placement=placement))
    carrier = links[-1]
    last[body] = carrier.name
    mass = float(model.body_mass[body])
    if mass:
        mujoco.mju_quat2Mat(turn, model.body_iquat[body])
        axes = turn.reshape(3, 3)
        inertia = axes @ np.diag(model.body_inertia[body]) @ axes.T
        carrier.inertials.append(Inertial(mass=mass, com=model.body_ipos[body].copy(), inertia=inertia))
    carrier.tips += _tips(model, body)
    return links


def _tips(model: mujoco.MjModel, body: int) -> list[Tip]:
    found, turn = [], np.empty(9)
    for g in np.flatnonzero(model.geom_bodyid == body):
        geom, size, kind = model.geom(g), model.geom_size[g], int(model.geom_type[g])
        mujoco.mju_quat2Mat(turn, model.geom_quat[g])
        frame = placed(turn.reshape(3, 3), model.geom_pos[g])
        collides = bool(model.geom_contype[g] or model.geom_conaffinity[g])
        rank = (0 if name_of_foot(geom.name) else 1) if collides else 2
        half = {
            int(mujoco.mjtGeom.mjGEOM_SPHERE): size[0],
            int(mujoco.mjtGeom.mjGEOM_CAPSULE): size[1] + size[0],
            int(mujoco.mjtGeom.mjGEOM_CYLINDER): size[1],
            int(mujoco.mjtGeom.mjGEOM_BOX): size[2],
        }.get(kind)
        if half is None:
            continue
        shape = mujoco.mjtGeom(kind).name.removeprefix("mjGEOM_").lower()
        for z in (-half, half):
            words = f"end of its {'' if collides else 'visual '}{shape} {geom.name}".rstrip()
            found.append(Tip(what=words, point=at(frame, np.array([0.0, 0.0, z])), rank=rank))
    for s in np.flatnonzero(model.site_bodyid == body):
        name = model.site(s).name
        if name_of_foot(name):
            found.append(Tip(what=f"site {name}", point=model.site_pos[s].copy(), rank=-1))
    return found


def _joint(model: mujoco.MjModel, j: int, motors: dict[int, float], path: Path) -> Joint:
    name, kind = model.joint(j).name or f"joint {j}", KINDS.get(int(model.jnt_type[j]))
    if kind is None:
        raise UserError(
            f"{path}: joint {name} is a ball; joints must be hinges about one axis, on a base of slides and a hinge"
        )
    dof, address = int(model.jnt_dofadr[j]), int(model.jnt_qposadr[j])
    low, high = model.jnt_range[j] if model.jnt_limited[j] else (-math.inf, math.inf)
    return Joint(
        name=name,
        kind=kind,
        axis=model.jnt_axis[j].copy(),
        anchor=model.jnt_pos[j].copy(),
        zero=float(model.qpos0[address]),
        low=float(low) if low > -FULL_TURN else -math.inf,
        high=float(high) if high < FULL_TURN else math.inf,
        effort=motors.get(j, math.nan),
        damping=float(model.dof_damping[dof]),
        friction=float(model.dof_frictionloss[dof]),
        rotor=float(model.dof_armature[dof]),
        stiffness=float(model.jnt_stiffness[j]),
        rest=float(model.qpos_spring[address]),
    )


def _motors(model: mujoco.MjModel, rows: list[Row]) -> dict[int, float]:
    """Largest torque of each joint that a motor drives, in [N.m]; servos are left out."""
    found: dict[int, float] = {}
    for a in range(model.nu):
        name = model.actuator(a).name or f"actuator {a}"
        if model.actuator_trntype[a] != mujoco.mjtTrn.mjTRN_JOINT:
            rows.append(Row(part=name, found="drives no joint", made="motors in the joints", verdict="left out"))
            continue
        joint = int(model.actuator_trnid[a, 0])
        if model.actuator_biastype[a] != mujoco.mjtBias.mjBIAS_NONE:
            words = f"a servo on {model.joint(joint).name}"
            rows.append(Row(part=name, found=words, made="the controller's torque instead", verdict="left out"))
            continue
        gear, gain = abs(float(model.actuator_gear[a, 0])), abs(float(model.actuator_gainprm[a, 0]))
        most = math.inf
        if model.actuator_ctrllimited[a]:
            most = min(most, gain * float(np.abs(model.actuator_ctrlrange[a]).min()))
        if model.actuator_forcelimited[a]:
            most = min(most, float(np.abs(model.actuator_forcerange[a]).min()))
        torque = gear * most
        if model.jnt_actfrclimited[joint]:
            torque = min(torque, float(np.abs(model.jnt_actfrcrange[joint]).min()))
        if math.isfinite(torque):
            found[joint] = max(found.get(joint, 0.0), torque)
            if gear != 1.0 or gain != 1.0:
                words = f"gear {gear:g}, gain {gain:g}, control up to {most / gain:g}"
                made = f"torque up to {torque:g} N.m, without gear"
                rows.append(Row(part=name, found=words, made=made, verdict="made"))
    return found


class Published:
    """The file as MuJoCo reads it, its base taken off and its torso set free."""

    def __init__(self, path: Path, torso: str) -> None:
        """Read.

        Args:
            path: The MJCF.
            torso: Body whose own joints are the base.

        Raises:
            UserError: not an MJCF MuJoCo can compile.
        """
        spec, _ = bare(path)
        for item in [*spec.actuators, *spec.sensors, *spec.equalities, *spec.keys, *spec.tendons]:
            spec.delete(item)
        body = spec.body(torso)
        for joint in list(body.joints):
            spec.delete(joint)
        body.add_freejoint()
        spec.option.gravity = [0.0, 0.0, -GRAVITY]
        spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
        self.model = mjcf.compile_spec(spec, str(path))
        self.data = mujoco.MjData(self.model)
        self.root = int(self.model.body(torso).jntadr[0])

    def at(
        self, rotation: Array, place: Array, rates: Array, joints: dict[str, tuple[float, float]]
    ) -> tuple[Array, Array, list[int]]:
        """Mass matrix and bias in the file's own velocities.

        Args:
            rotation: Of the torso body, (3, 3).
            place: Of its origin in [m], (3,).
            rates: Its linear velocity in the world and its angular velocity in its own frame, (6,).
            joints: Coordinate and rate of each joint.

        Returns:
            Mass matrix, bias, and where each of the joints is among the velocities.
        """
        model, data = self.model, self.data
        address, dof = int(model.jnt_qposadr[self.root]), int(model.jnt_dofadr[self.root])
        data.qpos[address : address + 3] = place
        mujoco.mju_mat2Quat(data.qpos[address + 3 : address + 7], np.ascontiguousarray(rotation).ravel())
        data.qvel[dof : dof + 6] = rates
        index = []
        for name, (angle, rate) in joints.items():
            j = model.joint(name)
            data.qpos[j.qposadr[0]], data.qvel[j.dofadr[0]] = angle, rate
            index.append(int(j.dofadr[0]))
        mujoco.mj_forward(model, data)
        full = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, full)
        return full, data.qfrc_bias.copy(), [*range(dof, dof + 6), *index]

    def point(self, body: str, point: Array) -> Array:
        """A point of a body in the world, after `at`, (3,)."""
        i = self.model.body(body).id
        seen: Array = self.data.xpos[i] + self.data.xmat[i].reshape(3, 3) @ point
        return seen
