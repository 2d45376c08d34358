"""MuJoCo's interactive window on a running plant."""

import contextlib
import os
import sys
import threading
import time
from collections.abc import Iterator

from sim.errors import UserError
from sim.loop import Stop
from sim.plant import Walker

EXTENT = 2.0  # [m] of what is looked at
FRAME = 1 / 60  # [s]
CLOSING = 2.0  # [s] for the window to close


def check_display() -> None:
    """See before a run that a window can be shown.

    Raises:
        UserError: there is no display, or this system's Python cannot open a window beside a running program.
    """
    if sys.platform.startswith("linux") and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise UserError("--viewer needs a display and there is none; cmpc video makes a film of a log without one")


@contextlib.contextmanager
def viewer(plant: Walker, period: float, stop: Stop | None) -> Iterator[Stop]:
    """Show a plant while it runs, no faster than real time; closing the window ends the run.

    Args:
        plant: The plant, already reset.
        period: Control period in [s].
        stop: Asked as well.

    Yields:
        What the loop asks every tick.

    Raises:
        UserError: the window cannot be opened.
    """
    import mujoco.viewer

    plant.model.stat.extent = EXTENT  # for the camera alone: the ground may be a kilometre long
    before = set(threading.enumerate())
    try:
        opened = mujoco.viewer.launch_passive(plant.model, plant.data, show_left_ui=False, show_right_ui=False)
    except RuntimeError as error:
        raise UserError(f"--viewer: MuJoCo's window cannot be opened: {error}") from error
    with opened as window:
        with window.lock():
            window.cam.type = mujoco.mjtCamera.mjCAMERA_TRACKING
            window.cam.trackbodyid = plant.model.body("torso").id
            window.cam.distance, window.cam.azimuth, window.cam.elevation = 3.0, 90.0, -10.0
        began, ticks, shown = time.perf_counter(), 0, 0.0

        def look() -> str | None:
            nonlocal ticks, shown
            if not window.is_running():
                return "the viewer was closed"
            now = time.perf_counter()
            if now - shown >= FRAME:
                window.sync()
                shown = now
            time.sleep(max(0.0, began + ticks * period - now))
            ticks += 1
            return stop() if stop else None

        yield look
    for thread in set(threading.enumerate()) - before:
        thread.join(CLOSING)  # the window's own thread; a process that ends before it crashes
