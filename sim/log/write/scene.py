"""What 3D panels draw: link frames as foxglove.FrameTransforms, link shapes as one foxglove.SceneUpdate.

A frame sits at the link's proximal joint and its z axis runs along the link. Angles are counter-clockwise in
the x-z plane, measured from "up": rotations about the axis (0, -1, 0).
"""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from math import atan2, cos, hypot, sin
from typing import Any

from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate

from sim.interface import COORDINATES, LEGS, PlantState
from sim.log.format.fields import LINKS

WORLD = "world"
_RADIUS = 0.025  # [m] of the drawn links
_FOOT_RADIUS = 0.03  # [m] of the drawn feet
_GROUND_WIDTH, _GROUND_THICKNESS = 2.0, 0.02  # [m]
_LINK_COLOUR = {"torso": (0.35, 0.35, 0.4), "left": (0.13, 0.45, 0.75), "right": (0.85, 0.4, 0.15)}
_GROUND_COLOUR = (0.75, 0.75, 0.72)


def link_poses(state: PlantState, femur_length: Mapping[str, float]) -> dict[str, tuple[float, float, float]]:
    """Pose of each link frame.

    Args:
        state: Truth at one tick.
        femur_length: Length of the femur of each leg in [m].

    Returns:
        Link -> (x, z, phi): position of its proximal joint in [m], absolute angle in [rad].
    """
    q = dict(zip(COORDINATES, state.q.tolist(), strict=True))
    x, z = state.hip.tolist()
    poses = {"torso": (x, z, q["torso"])}
    for leg in LEGS:
        femur = q["torso"] + q[f"{leg}_hip"]
        length = femur_length[leg]
        poses[f"{leg}_femur"] = (x, z, femur)
        poses[f"{leg}_tibia"] = (x - length * sin(femur), z + length * cos(femur), femur + q[f"{leg}_knee"])
    return poses


def frame_transforms(time_ns: int, state: PlantState, femur_length: Mapping[str, float]) -> bytes:
    """Serialised FrameTransforms: world -> every link.

    Args:
        time_ns: Log time in [ns].
        state: Truth at that time.
        femur_length: Length of the femur of each leg in [m].
    """
    message = FrameTransforms()
    for link, (x, z, phi) in link_poses(state, femur_length).items():
        transform = message.transforms.add(parent_frame_id=WORLD, child_frame_id=link)
        set_time(transform.timestamp, time_ns)
        transform.translation.x, transform.translation.z = x, z
        transform.rotation.y, transform.rotation.w = -sin(phi / 2), cos(phi / 2)
    return message.SerializeToString(deterministic=True)


def scene_update(link_lengths: Mapping[str, float], ground: Sequence[tuple[float, float]]) -> bytes:
    """Serialised SceneUpdate: a bar a link, a ball a foot, the ground.

    Args:
        link_lengths: Length of each of `LINKS` in [m].
        ground: Line of the ground through (x, z) in [m].
    """
    message = SceneUpdate()
    for link in LINKS:
        entity = message.entities.add(frame_id=link, id=link, frame_locked=True)
        colour = _LINK_COLOUR[link.partition("_")[0]]
        length = link_lengths[link]
        bar = entity.cylinders.add(bottom_scale=1.0, top_scale=1.0)
        bar.pose.position.z = length / 2
        bar.pose.orientation.w = 1.0
        bar.size.x = bar.size.y = 2 * _RADIUS
        bar.size.z = length
        _paint(bar.color, colour)
        if link.endswith("tibia"):
            foot = entity.spheres.add()
            foot.pose.position.z = length
            foot.pose.orientation.w = 1.0
            foot.size.x = foot.size.y = foot.size.z = 2 * _FOOT_RADIUS
            _paint(foot.color, colour)
    floor = message.entities.add(frame_id=WORLD, id="ground", frame_locked=True)
    for (x0, z0), (x1, z1) in pairwise(ground):
        if x1 > x0:
            _add_plate(floor.cubes.add(), x0, z0, x1, z1)
    return message.SerializeToString(deterministic=True)


def _add_plate(plate: Any, x0: float, z0: float, x1: float, z1: float) -> None:
    """A plate whose upper side runs from one point to the other."""
    angle = atan2(z1 - z0, x1 - x0)
    plate.size.x, plate.size.y, plate.size.z = hypot(x1 - x0, z1 - z0), _GROUND_WIDTH, _GROUND_THICKNESS
    half = _GROUND_THICKNESS / 2
    plate.pose.position.x = (x0 + x1) / 2 + half * sin(angle)
    plate.pose.position.z = (z0 + z1) / 2 - half * cos(angle)
    plate.pose.orientation.y, plate.pose.orientation.w = -sin(angle / 2), cos(angle / 2)
    _paint(plate.color, _GROUND_COLOUR)


def set_time(timestamp: Any, time_ns: int) -> None:
    """Write a time in [ns] into a protobuf Timestamp."""
    timestamp.seconds, timestamp.nanos = divmod(time_ns, 1_000_000_000)


def _paint(colour: Any, rgb: tuple[float, float, float]) -> None:
    colour.r, colour.g, colour.b = rgb
    colour.a = 1.0
