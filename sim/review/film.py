"""Films and pictures of a run, drawn by MuJoCo from the plant's own model; no display is needed."""

import contextlib
import importlib.util
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim.errors import UserError
from sim.log.read import Log
from sim.log.read.attachments import scenario_of, unpacked
from sim.log.read.frames import run_of
from sim.review.signals import Signals, signals_of

KINDS = (".mp4", ".gif", ".png")
EXTENT = 2.0  # [m] of what is looked at
MOST_ARROWS = 20
MOST_PIXELS = 4096  # on a side
GL_HELP = (
    "MuJoCo cannot draw here: it needs EGL or OSMesa. On Debian or Ubuntu: apt install libegl1 libgl1-mesa-dri "
    "(EGL) or libosmesa6 (then set MUJOCO_GL=osmesa)"
)
_FRONT = -0.1  # [m] y of the arrows, before both legs as the camera sees them
_ARROW_WIDTH = 0.012  # [m]
_COLOURS = {"contact": (0.13, 0.6, 0.3, 1.0), "push": (0.8, 0.1, 0.2, 1.0)}


def film(
    log: Log, target: Path, *, fps: float, size: tuple[int, int], speed: float, start: float, end: float | None
) -> int:
    """Draw a run into a file.

    Args:
        log: The log.
        target: An .mp4, .gif or .png (a picture of the moment `start`); must not exist.
        fps: Pictures in a second of film [1/s].
        size: Width and height in [pixel].
        speed: Speed of the film, 1 for real time.
        start: First moment in [s].
        end: Last moment in [s]; None for the end of the run.

    Returns:
        Pictures drawn.

    Raises:
        UserError: the log cannot be drawn, a package or OpenGL is missing, or the file cannot be written.
    """
    _check(target, fps, size, speed)
    signals = signals_of(run_of(log))
    last = min(float(signals.t[-1]), end if end is not None else np.inf)
    if not 0.0 <= start <= last:
        raise UserError(f"--start {start:g} s: must be within 0 and {last:g} s")
    times = [start] if target.suffix == ".png" else np.arange(start, last + 1e-9, speed / fps).tolist()
    with _writer(target, fps) as write, _camera(log, size) as draw:
        for t in times:
            write(draw(signals, t))
    return len(times)


def _check(target: Path, fps: float, size: tuple[int, int], speed: float) -> None:
    if target.suffix not in KINDS:
        raise UserError(f"{target}: must end in one of {', '.join(KINDS)}")
    if target.exists():
        raise UserError(f"{target}: already exists and is never overwritten; choose another name")
    if not all(16 <= side <= MOST_PIXELS for side in size):
        raise UserError(f"--size {size[0]} {size[1]} pixels: each must be within 16 and {MOST_PIXELS}")
    if not 1.0 <= fps <= 240.0:
        raise UserError(f"--fps {fps:g} 1/s: must be within 1 and 240")
    if not 0.01 <= speed <= 100.0:
        raise UserError(f"--speed {speed:g}: must be within 0.01 and 100")
    needed = {".mp4": ("imageio", "imageio_ffmpeg"), ".gif": ("PIL",), ".png": ("PIL",)}[target.suffix]
    missing = [name for name in needed if importlib.util.find_spec(name) is None]
    if missing:
        raise UserError(f'{target.suffix} needs the packages of the extra "video": pip install "cmpc-walker[video]"')


@contextlib.contextmanager
def _writer(target: Path, fps: float) -> Iterator[Any]:
    """Takes pictures, (height, width, 3) of bytes; nothing is left behind when drawing fails."""
    try:
        if target.suffix == ".mp4":
            import imageio.v2

            video: Any = imageio.v2.get_writer(target, fps=fps, codec="libx264", quality=8, macro_block_size=2)
            with video:
                yield video.append_data
            return
        from PIL import Image

        pictures: list[Any] = []

        def keep(pixels: NDArray[np.uint8]) -> None:
            image = Image.fromarray(pixels)
            pictures.append(image.quantize(128) if target.suffix == ".gif" else image)

        yield keep
        rest = {"save_all": True, "append_images": pictures[1:], "duration": round(1000 / fps), "loop": 0}
        pictures[0].save(target, **(rest if target.suffix == ".gif" else {}))
    except OSError as error:
        target.unlink(missing_ok=True)
        raise UserError(f"{target}: cannot be written: {error.strerror or error}") from error
    except BaseException:
        target.unlink(missing_ok=True)
        raise


@contextlib.contextmanager
def _camera(log: Log, size: tuple[int, int]) -> Iterator[Any]:
    """Gives a function (signals, time in [s]) -> picture."""
    if "MUJOCO_GL" not in os.environ and sys.platform.startswith("linux") and not os.environ.get("DISPLAY"):
        os.environ["MUJOCO_GL"] = "egl"  # read by mujoco when it is imported
    try:
        import mujoco

        from sim.bridge.run import build_plant
    except (ImportError, AttributeError, RuntimeError) as error:
        raise UserError(f"{GL_HELP} ({type(error).__name__}: {error})") from error
    scenario = scenario_of(log)
    with unpacked(scenario, log.attachments) as files:
        model = build_plant(scenario, files).model
    model.vis.global_.offwidth, model.vis.global_.offheight = size
    model.stat.extent = EXTENT  # ground a kilometre long would push the near clipping plane behind the walker
    model.vis.quality.shadowsize = 1024  # a software renderer spends its time on shadows
    try:
        renderer = mujoco.Renderer(model, height=size[1], width=size[0], max_geom=model.ngeom + MOST_ARROWS)
    except Exception as error:  # every GL back end fails in its own way
        raise UserError(f"{GL_HELP} ({type(error).__name__}: {error})") from error
    renderer.scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = False
    arrows = _Arrows(log)
    data = mujoco.MjData(model)
    names = ("hip_x", "hip_z", "torso", "left_hip", "right_hip", "left_knee", "right_knee")
    address = [int(model.jnt_qposadr[model.joint(name).id]) for name in names]
    keys = ("hip.x", "hip.z", *(f"q.{name}" for name in names[2:]))
    view = mujoco.MjvCamera()
    view.distance, view.azimuth, view.elevation = 2.9, 90.0, -6.0

    def draw(signals: Signals, t: float) -> NDArray[np.uint8]:
        row = int(np.clip(np.searchsorted(signals.t, t + 1e-9) - 1, 0, len(signals.t) - 1))
        data.qpos[address] = [signals.columns[key][row] for key in keys]
        mujoco.mj_forward(model, data)
        x, z = signals.columns["hip.x"][row], signals.columns["hip.z"][row]
        view.lookat[:] = (x, 0.0, z - 0.12)
        renderer.update_scene(data, view)
        for kind, tail, tip in arrows.at(t):
            _add_arrow(mujoco, renderer.scene, kind, tail, tip)
        return np.asarray(renderer.render()).copy()

    try:
        yield draw
    finally:
        renderer.close()


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
