"""MuJoCo draws the walker of a log, and the forces on it."""

import contextlib
import os
import sys
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim.errors import UserError
from sim.log.read import Log
from sim.log.read.attachments import scenario_of, unpacked
from sim.review.signals import Signals

EXTENT = 2.0  # [m] of what is looked at
MOST_ARROWS = 20
GL_HELP = (
    "MuJoCo cannot draw here: it needs EGL or OSMesa. On Debian or Ubuntu: apt install libegl1 libgl1-mesa-dri "
    "(EGL) or libosmesa6 (then set MUJOCO_GL=osmesa)"
)
HEIGHT = 1.75  # [m] that a picture shows from below the feet to above the head
LOOKED_AT = 0.12  # [m] below the hip, the middle of a picture
NARROW = 18.0  # [deg] of a still's field of view, so that walkers at its sides stand as upright as in its middle
FADED = 0.35  # of the colour of the first of several walkers in a picture
_FRONT = -0.1  # [m] y of the arrows, before both legs as the camera sees them
_ARROW_WIDTH = 0.012  # [m]
_COLOURS = {"contact": (0.13, 0.6, 0.3, 1.0), "push": (0.8, 0.1, 0.2, 1.0)}

Pixels = NDArray[np.uint8]
"""A picture, (height, width, 3)."""


class Camera:
    """Draws moments of one log."""

    def __init__(self, mujoco: Any, model: Any, log: Log, size: tuple[int, int], poses: int) -> None:
        """Args: poses: walkers that one picture may hold; the rest as for `camera`."""
        model.vis.global_.offwidth, model.vis.global_.offheight = size
        model.stat.extent = EXTENT  # ground a kilometre long would push the near clipping plane behind the walker
        model.vis.quality.shadowsize = 1024  # a software renderer spends its time on shadows
        self._mujoco, self._model, self._size = mujoco, model, size
        try:
            most = poses * (model.ngeom + MOST_ARROWS)
            self._renderer = mujoco.Renderer(model, height=size[1], width=size[0], max_geom=most)
        except Exception as error:  # every GL back end fails in its own way
            raise UserError(f"{GL_HELP} ({type(error).__name__}: {error})") from error
        self._renderer.scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = False
        self._arrows = _Arrows(log)
        self._data = mujoco.MjData(model)
        names = ("hip_x", "hip_z", "torso", "left_hip", "right_hip", "left_knee", "right_knee")
        self._address = [int(model.jnt_qposadr[model.joint(name).id]) for name in names]
        self._keys = ("hip.x", "hip.z", *(f"q.{name}" for name in names[2:]))
        self._view = mujoco.MjvCamera()
        self._view.azimuth, self._view.elevation = 90.0, -6.0

    def close(self) -> None:
        """Give OpenGL back."""
        self._renderer.close()

    def draw(self, signals: Signals, t: float) -> Pixels:
        """The walker at a time in [s], in the middle of the picture."""
        row = self._pose(signals, t)
        self._look(signals.columns["hip.x"][row], signals.columns["hip.z"][row] - LOOKED_AT, HEIGHT)
        self._renderer.update_scene(self._data, self._view)
        self._add_arrows(t)
        return np.asarray(self._renderer.render()).copy()

    def draw_all(self, signals: Signals, times: Sequence[float]) -> tuple[Pixels, list[float]]:
        """The walker at several times in one picture; the first are faded.

        Args:
            signals: Of the log.
            times: In [s], in order.

        Returns:
            The picture, and where in it each hip is, from the left in [pixel].
        """
        rows = [self._row(signals, t) for t in times]
        xs, zs = (signals.columns[f"hip.{axis}"][rows] for axis in "xz")
        width, height = self._size
        across = max(float(np.ptp(xs)) + 1.3, HEIGHT * width / height)  # [m]
        self._model.vis.global_.fovy = NARROW
        middle = float(xs.max() + xs.min()) / 2.0
        self._look(middle, float(np.median(zs)) - LOOKED_AT, across * height / width)
        scene, everything = self._renderer.scene, self._mujoco.mjtCatBit
        self._pose(signals, times[-1])
        self._renderer.update_scene(self._data, self._view)
        for at, t in enumerate(times):
            self._pose(signals, t)
            first = scene.ngeom
            if at < len(times) - 1:  # the last is there with the ground
                options, grip = self._mujoco.MjvOption(), self._mujoco.MjvPerturb()
                moving = everything.mjCAT_DYNAMIC
                self._mujoco.mjv_addGeoms(self._model, self._data, options, grip, moving, scene)
                share = FADED + (1.0 - FADED) * at / (len(times) - 1)
                for geom in scene.geoms[first : scene.ngeom]:
                    geom.rgba[:] = 1.0 - share * (1.0 - geom.rgba[:])  # towards white; the whole of it is there
                    geom.rgba[3], geom.matid = 1.0, -1
            self._add_arrows(t)
        picture = np.asarray(self._renderer.render()).copy()
        return picture, (width / 2.0 + (xs - middle) / across * width).tolist()

    def _look(self, x: float, z: float, height: float) -> None:
        """Look at (x, z) in [m] from so far that `height` in [m] is seen."""
        self._view.lookat[:] = (x, 0.0, z)
        self._view.distance = height / 2.0 / np.tan(np.radians(self._model.vis.global_.fovy) / 2.0)

    def _row(self, signals: Signals, t: float) -> int:
        return int(np.clip(np.searchsorted(signals.t, t + 1e-9) - 1, 0, len(signals.t) - 1))

    def _pose(self, signals: Signals, t: float) -> int:
        row = self._row(signals, t)
        self._data.qpos[self._address] = [signals.columns[key][row] for key in self._keys]
        self._mujoco.mj_forward(self._model, self._data)
        return row

    def _add_arrows(self, t: float) -> None:
        for kind, tail, tip in self._arrows.at(t):
            _add_arrow(self._mujoco, self._renderer.scene, kind, tail, tip)


@contextlib.contextmanager
def camera(log: Log, size: tuple[int, int], poses: int = 1) -> Iterator[Camera]:
    """A camera on the walker of a log.

    Args:
        log: It.
        size: Width and height of its pictures in [pixel].
        poses: Walkers that one picture may hold.

    Raises:
        UserError: OpenGL is missing, or the log does not hold what it takes.
    """
    if "MUJOCO_GL" not in os.environ and sys.platform.startswith("linux") and not os.environ.get("DISPLAY"):
        os.environ["MUJOCO_GL"] = "egl"  # read by mujoco when it is imported
    try:
        import mujoco

        from sim.bridge.run import build_plant
    except (ImportError, AttributeError, RuntimeError) as error:
        raise UserError(f"{GL_HELP} ({type(error).__name__}: {error})") from error
    scenario = scenario_of(log)
    with unpacked(scenario, log.attachments) as files:
        model = build_plant(scenario, files, pictures=True).model
    made = Camera(mujoco, model, log, size, poses)
    try:
        yield made
    finally:
        made.close()


class _Arrows:
    """Forces of a log as (kind, tail, tip), both (x, y, z) in [m]."""

    def __init__(self, log: Log) -> None:
        self._frames = log.messages("/forces") if "/forces" in log.channels else []
        self._times = np.array([time_ns * 1e-9 for time_ns, _ in self._frames])

    def at(self, t: float) -> Iterator[tuple[str, list[float], list[float]]]:
        """Arrows of the frame at or just before a time in [s]."""
        row = int(np.searchsorted(self._times, t + 1e-9)) - 1
        if row < 0 or t - self._times[row] > 0.03:
            return
        for entity in self._frames[row][1].entities:
            kind = entity.id.partition(".")[0]
            if kind not in _COLOURS or not entity.arrows:
                continue
            arrow = entity.arrows[0]
            turn = arrow.pose.orientation
            length = min(arrow.shaft_length + arrow.head_length, 1.5)
            tail = [arrow.pose.position.x, _FRONT, arrow.pose.position.z]
            along = (1.0 - 2.0 * turn.y**2, 0.0, -2.0 * turn.w * turn.y)
            yield kind, tail, [p + length * d for p, d in zip(tail, along, strict=True)]


def _add_arrow(mujoco: Any, scene: Any, kind: str, tail: list[float], tip: list[float]) -> None:
    if scene.ngeom >= scene.maxgeom:
        return
    geom = scene.geoms[scene.ngeom]
    rgba = np.array(_COLOURS[kind], np.float32)
    arrow = mujoco.mjtGeom.mjGEOM_ARROW
    mujoco.mjv_initGeom(geom, arrow, np.zeros(3), np.zeros(3), np.zeros(9), rgba)
    mujoco.mjv_connector(geom, arrow, _ARROW_WIDTH, np.array(tail), np.array(tip))
    geom.size[2] *= 2.0  # MuJoCo draws an arrow half as long as its size says
    scene.ngeom += 1
