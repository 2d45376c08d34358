"""A log in Rerun: links, ground and forces as entities that it draws, every number as a curve, events as a text log.

Rerun opens our MCAP files and shows their numbers, but draws no foxglove.SceneUpdate: here the same messages become
capsules, a line and arrows, and the layout a blueprint.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.Log_pb2 import Log as LogMessage
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate

from sim.errors import UserError
from sim.log.format.fields import CHANNELS
from sim.log.format.layout import HEADER, layout_of
from sim.log.format.schema import descriptor
from sim.log.read import Log
from sim.log.read.frames import run_of
from sim.log.read.log import time_ns
from sim.log.tools.text import printable
from sim.pages.palette import COLOURS
from sim.review.facts import limit_of_torque
from sim.review.layouts import TABS, series_name

NAME = "cmpc"
CLOCK = "time"
LEVELS = {1: "DEBUG", 2: "INFO", 3: "WARN", 4: "ERROR", 5: "CRITICAL"}
EYE = (0.6, -3.2, 0.9)  # [m], where one looks from at first
_TABLES = {channel.topic: channel for channel in CHANNELS}


def blueprint(limits: Mapping[str, float] | None = None) -> rrb.Blueprint:
    """The walker and the events on the left, the tabs of plots on the right.

    Args:
        limits: Torque limit in [N.m] by joint, which rule the axes of the torques: those of a fall say nothing.
    """
    ranges = {f"{joint.replace('_', ' ')} [N.m]": (-1.3 * x, 1.3 * x) for joint, x in (limits or {}).items()}
    walker = rrb.Spatial3DView(
        origin="/world",
        name="walker",
        eye_controls=rrb.EyeControls3D(
            position=EYE, look_target=(0.6, 0.0, 0.6), eye_up=(0.0, 0.0, 1.0), tracking_entity="/world/torso"
        ),
    )
    tabs = [
        rrb.Grid(
            *(
                rrb.TimeSeriesView(
                    name=plot.title,
                    contents=[f"/{_entity(path)}" for path in plot.curves],
                    axis_y=rrb.ScalarAxis(range=ranges[plot.title]) if plot.title in ranges else None,
                )
                for plot in plots
                if not plot.x
            ),
            name=tab,
        )
        for tab, plots in TABS.items()
    ]
    left = rrb.Vertical(walker, rrb.TextLogView(origin="/events", name="events"), row_shares=[3, 1])
    right = rrb.Tabs(*tabs)
    both = rrb.Horizontal(left, right, column_shares=[2, 3])
    return rrb.Blueprint(both, rrb.TimePanel(timeline=CLOCK, state="collapsed"), collapse_panels=True)


class Drawer:
    """Takes messages of a log and logs what Rerun draws."""

    def __init__(self, recording: rr.RecordingStream) -> None:
        """Args: recording: where it goes."""
        self._to = recording
        self._forces: set[str] = set()
        for plots in TABS.values():
            for plot in plots:
                for (path, label), colour in zip(plot.curves.items(), COLOURS, strict=False):
                    self._to.log(_entity(path), rr.SeriesLines(names=label, colors=_rgb(colour)), static=True)

    def take(self, topic: str, records: Sequence[bytes]) -> None:
        """Messages of one channel, as MCAP records, in order of time."""
        if not records:
            return
        if topic in _TABLES:
            self._columns(topic, records)
            return
        draw = {"/scene": self._scene, "/tf": self._frames, "/forces": self._arrows, "/events": self._event}.get(topic)
        for record in records if draw else ():
            self._to.set_time(CLOCK, duration=1e-9 * time_ns(record))
            draw(record[HEADER:])  # type: ignore[misc]

    def _columns(self, topic: str, records: Sequence[bytes]) -> None:
        layout = layout_of(descriptor(_TABLES[topic]))
        rows = np.frombuffer(b"".join(record[HEADER:] for record in records), layout.dtype)
        clock = rr.TimeColumn(CLOCK, duration=[1e-9 * time_ns(record) for record in records])
        for name in layout.names:
            columns = rr.Scalars.columns(scalars=rows[name].astype(np.float64))
            self._to.send_columns(_entity(f"{topic}.{name}"), indexes=[clock], columns=columns)

    def _scene(self, data: bytes) -> None:
        for entity in SceneUpdate.FromString(data).entities:
            for bar in entity.cylinders:
                long, wide, colour = bar.size.z, bar.size.x / 2, _colour(bar.color)
                shape = rr.Capsules3D(lengths=[long], radii=[wide], colors=[colour], fill_mode="solid")
                self._to.log(f"world/{entity.id}/bar", shape, static=True)
            for ball in entity.spheres:
                at = ball.pose.position
                point = rr.Points3D([(at.x, at.y, at.z)], radii=[ball.size.x / 2], colors=[_colour(ball.color)])
                self._to.log(f"world/{entity.id}/foot", point, static=True)
            if entity.cubes:
                poses = [cube.pose for cube in entity.cubes]
                plates = rr.Boxes3D(
                    centers=[(pose.position.x, pose.position.y, pose.position.z) for pose in poses],
                    sizes=[(cube.size.x, cube.size.y, cube.size.z) for cube in entity.cubes],
                    quaternions=[rr.Quaternion(xyzw=_turn(pose.orientation)) for pose in poses],
                    colors=[_colour(cube.color) for cube in entity.cubes],
                    fill_mode="solid",
                )
                self._to.log(f"world/{entity.id}", plates, static=True)

    def _frames(self, data: bytes) -> None:
        for one in FrameTransforms.FromString(data).transforms:
            at = one.translation
            turn = rr.Quaternion(xyzw=_turn(one.rotation))
            self._to.log(f"world/{one.child_frame_id}", rr.Transform3D(translation=(at.x, at.y, at.z), quaternion=turn))

    def _arrows(self, data: bytes) -> None:
        seen = set()
        for entity in SceneUpdate.FromString(data).entities:
            for arrow in entity.arrows:
                at, turn = arrow.pose.position, arrow.pose.orientation
                length = arrow.shaft_length + arrow.head_length
                along = ((1.0 - 2.0 * turn.y**2) * length, 0.0, -2.0 * turn.w * turn.y * length)
                drawn = rr.Arrows3D(
                    origins=[(at.x, -0.1, at.z)], vectors=[along], radii=[0.012], colors=[_colour(arrow.color)]
                )
                self._to.log(f"world/forces/{entity.id}", drawn)
                seen.add(entity.id)
        for gone in self._forces - seen:
            self._to.log(f"world/forces/{gone}", rr.Clear(recursive=False))
        self._forces = seen

    def _event(self, data: bytes) -> None:
        event = LogMessage.FromString(data)
        text = printable(f"{event.name}: {event.message}")
        self._to.log("events", rr.TextLog(text, level=LEVELS.get(event.level, "INFO")))


def write_recording(log: Log, target: Path) -> None:
    """Write a log as a recording with its layout.

    Args:
        log: The log.
        target: The .rrd; must not exist.

    Raises:
        UserError: it exists already, or cannot be written.
    """
    if target.exists():
        raise UserError(f"{target}: already exists and is never overwritten; choose another name")
    if not target.parent.is_dir():
        raise UserError(f"{target}: {target.parent} is no folder; make it first or choose another path")
    recording = rr.RecordingStream(NAME, recording_id=printable(log.path.stem))
    recording.save(target, default_blueprint=blueprint(limit_of_torque(run_of(log))))
    drawer = Drawer(recording)
    for topic in log.own:
        drawer.take(topic, log.records(topic))
    recording.flush()
    recording.disconnect()


def _entity(path: str) -> str:
    """Entity of a message path: "/control.u_zd.left_hip" is "control/u_zd/left_hip"."""
    return series_name(path).lstrip("/")


def _turn(quaternion: Any) -> tuple[float, float, float, float]:
    return quaternion.x, quaternion.y, quaternion.z, quaternion.w


def _colour(colour: Any) -> tuple[int, int, int, int]:
    r, g, b, a = (round(255 * part) for part in (colour.r, colour.g, colour.b, colour.a))
    return r, g, b, a


def _rgb(text: str) -> tuple[int, int, int]:
    r, g, b = bytes.fromhex(text[1:])
    return r, g, b
