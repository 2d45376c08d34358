"""Forces as arrows for 3D panels: foxglove.SceneUpdate at the rate of the frames."""

from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import atan2, cos, hypot, sin

from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate

from sim.interface import LEGS, PlantState
from sim.log.write.scene import WORLD, link_poses, set_time

CONTACT_SCALE = 1.0 / 1000.0  # [m/N]: the weight of the walker is drawn 0.3 m long
PUSH_SCALE = 1.0 / 80.0  # [m/N]
SMALLEST = 0.5  # [N]; nothing is drawn below
CONTACT_COLOUR = (0.13, 0.6, 0.3)
PUSH_COLOUR = (0.8, 0.1, 0.2)
_SHAFT, _HEAD = 0.018, 0.045  # [m] diameters
_HEAD_LENGTH = 0.06  # [m]


@dataclass(frozen=True, slots=True, kw_only=True)
class Arrow:
    """A force to draw.

    Attributes:
        name: "push.0", "contact.left" and so on.
        tail: Where the arrow begins, (x, z) in [m].
        force: (x, z) in the world frame in [N].
        scale: Length of the arrow in [m/N].
    """

    name: str
    tail: tuple[float, float]
    force: tuple[float, float]
    scale: float


class GroundAngle:
    """Inclination of the ground in [rad] at x in [m]."""

    def __init__(self, ground: Sequence[tuple[float, float]]) -> None:
        """Args: ground: line through (x, z) in [m]."""
        facets = [(x0, atan2(z1 - z0, x1 - x0)) for (x0, z0), (x1, z1) in pairwise(ground) if x1 > x0]
        self._starts = [x for x, _ in facets]
        self._angles = [angle for _, angle in facets]

    def __call__(self, x: float) -> float:
        """Inclination of the facet under x; on a border, of the one that begins there."""
        return self._angles[max(0, bisect_right(self._starts, x) - 1)]


def arrows_of(state: PlantState, ground: GroundAngle, femur_length: Mapping[str, float]) -> list[Arrow]:
    """Every force of a tick: contact forces begin at the foot, pushes end where they attack.

    Args:
        state: Truth at the tick.
        ground: Inclination of the ground by place.
        femur_length: Length of the femur of each leg in [m].
    """
    found = []
    for leg, foot, (tangential, normal) in zip(LEGS, state.foot.tolist(), state.contact_force.tolist(), strict=True):
        angle = ground(foot[0])
        fx, fz = tangential * cos(angle) - normal * sin(angle), tangential * sin(angle) + normal * cos(angle)
        found.append(Arrow(name=f"contact.{leg}", tail=tuple(foot), force=(fx, fz), scale=CONTACT_SCALE))
    poses = link_poses(state, femur_length) if state.applied else {}
    for number, push in enumerate(state.applied):
        x, z, phi = poses[push.body]
        px, pz = push.point
        x, z = x + px * cos(phi) - pz * sin(phi), z + px * sin(phi) + pz * cos(phi)
        fx, fz = push.force
        tail = (x - fx * PUSH_SCALE, z - fz * PUSH_SCALE)
        found.append(Arrow(name=f"push.{number}", tail=tail, force=push.force, scale=PUSH_SCALE))
    return [arrow for arrow in found if hypot(*arrow.force) > SMALLEST]


def force_update(time_ns: int, arrows: list[Arrow], lifetime_ns: int) -> bytes:
    """Serialised SceneUpdate of arrows that vanish by themselves.

    Args:
        time_ns: Log time in [ns].
        arrows: What to draw.
        lifetime_ns: How long to show it in [ns].
    """
    message = SceneUpdate()
    for arrow in arrows:
        entity = message.entities.add(frame_id=WORLD, id=arrow.name)
        set_time(entity.timestamp, time_ns)
        set_time(entity.lifetime, lifetime_ns)
        fx, fz = arrow.force
        entity.metadata.add(key="x [N]", value=repr(fx))
        entity.metadata.add(key="z [N]", value=repr(fz))
        length = arrow.scale * hypot(fx, fz)
        angle = atan2(fz, fx)  # about (0, -1, 0), as every angle
        drawn = entity.arrows.add()
        drawn.pose.position.x, drawn.pose.position.z = arrow.tail
        drawn.pose.orientation.y, drawn.pose.orientation.w = -sin(angle / 2), cos(angle / 2)
        drawn.head_length = min(_HEAD_LENGTH, length / 2)
        drawn.shaft_length = length - drawn.head_length
        drawn.shaft_diameter, drawn.head_diameter = _SHAFT, _HEAD
        drawn.color.r, drawn.color.g, drawn.color.b = PUSH_COLOUR if arrow.name.startswith("push") else CONTACT_COLOUR
        drawn.color.a = 1.0
    return message.SerializeToString(deterministic=True)
