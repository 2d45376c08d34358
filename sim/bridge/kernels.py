"""Compiled kernels: where they lie, whether they are there, and their preparation in processes beside this one.

A first start compiles the kernels that its law and its plant need and no others, on two processors, with signs of how
far it is; this process stays free to be interrupted. What the others cannot do is compiled where it is asked for.
"""

import gc
import os
import selectors
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from importlib import import_module
from pathlib import Path
from typing import IO, Any

import numpy as np

from controller.common.compiled import ROOT, on_disk
from controller.common.settings import BUILT_IN
from sim.interface import LEGS
from sim.loop import Judge, Ticks

Show = Callable[[int, int, str], None]
"""Told the kernels compiled, about how many there are, and the one that came last."""

ONCE = "compiling kernels, once, about 20 s"
SLICE = 0.05  # [s] between looks at the wish to stop
YOUNG = 100_000  # objects before Python looks for garbage: a compiler makes many and drops few

TOPS = {
    "c-mpc": (
        "controller.cmpc.cascade_kernels:settle",
        "controller.cmpc.cascade_kernels:foresee",
        "sim.loop.ride:ride",
    ),
    "zd-pd": ("controller.cmpc.zero_dynamics:decide", "sim.loop.ride:ride"),
    "c-mpc-ltv": ("controller.ltv.plan:improve",),
    "c-mpc-plan": ("controller.plan.solve:improve", "controller.ltv.plan:improve"),
    "clf-qp": ("controller.rivals.output_dynamics:output_dynamics",),
    "output-mpc": ("controller.rivals.output_dynamics:output_dynamics",),
    "mujoco": ("sim.plant.mujoco_kernels:move",),
    "rigid": ("sim.plant.rigid_kernels:move",),
}
"""The kernels that are compiled last for a law or a plant."""

PARTS = {
    "c-mpc": (
        "controller.qp.riccati_solver:compile_kernels;sim.bridge.kernels:settle",
        "sim.bridge.kernels:look_ahead",
    )
}
"""What a law has that two processes compile at the same time; the first finds what both need made by the other, and
walks in the end."""

KERNELS = {"c-mpc": 115, "zd-pd": 45, "c-mpc-ltv": 75, "c-mpc-plan": 115, "clf-qp": 45, "output-mpc": 45}
"""About how many kernels a run under a law needs."""


def kernels() -> tuple[Path, bool]:
    """The folder that kernels are kept in, and whether those of C-MPC need no compiling."""
    return Path(named(TOPS["c-mpc"][0]).stats.cache_path).parent, ready("c-mpc", "mujoco")


def ready(kind: str, plant: str) -> bool:
    """Whether the kernels of a law and a plant need no compiling."""
    return all(on_disk(named(top)) for name in (law_of(kind), plant) for top in TOPS.get(name, ()))


def law_of(kind: str) -> str:
    """The built-in law whose kernels a controller needs, one from outside among them."""
    return kind if kind in BUILT_IN else "zd-pd"


def named(place: str) -> Any:
    """What "module:name" stands for."""
    module, _, name = place.partition(":")
    return getattr(import_module(module), name)


def unseen(done: int, total: int, name: str) -> None:
    """Show nothing."""


def prepare(kind: str, plant: str, *, stop: Callable[[], object] = lambda: None, show: Show = unseen) -> None:
    """Compile what a run under a law on a plant needs and lacks.

    Args:
        kind: Of the controller.
        plant: Kind of the plant, "mujoco" or "rigid".
        stop: Asked all the time; anything true ends it.
        show: Told how far it is.
    """
    law, done = law_of(kind), 0
    walk = f"sim.bridge.kernels:walk:{law}:{plant}"
    places: tuple[str, ...] = (walk,)
    if law in PARTS and not on_disk(named(TOPS[law][0])) and (os.cpu_count() or 1) > 1:
        first, *others = PARTS[law]
        places = (f"{first};{walk}", *others)
    for name in compiled_by(places, stop):
        done += 1
        show(done, max(KERNELS.get(law, 0), done), name)
        if stop():
            return


def prepare_all() -> None:
    """Compile what every law, both plants and the design of gaits need, on two processors: before all tests."""
    here = "sim.bridge.kernels"
    walks = (f"{here}:walk:{pair}" for pair in ("c-mpc:mujoco", "c-mpc:rigid", "zd-pd:rigid"))
    for stage in (
        PARTS["c-mpc"],
        (f"{here}:walk:c-mpc-ltv:mujoco", ";".join(walks)),
        (f"{here}:walk:c-mpc-plan:mujoco", f"{here}:walk:clf-qp:mujoco;{here}:gaits"),
    ):
        for _ in compiled_by(stage, lambda: None):
            pass


def compiled_by(places: Sequence[str], stop: Callable[[], object]) -> Iterator[str]:
    """Names of kernels, as processes that call functions compile them."""
    code = "import sys; from sim.bridge.kernels import serve; serve(sys.argv[1])"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), *filter(None, sys.path)])}
    selector = selectors.DefaultSelector()
    others = []
    try:
        for place in places:
            other = subprocess.Popen(
                [sys.executable, "-c", code, place],
                env=environment,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                start_new_session=True,  # a terminal's signals are for this process
            )
            others.append(other)
            selector.register(_pipe(other), selectors.EVENT_READ)
        while selector.get_map() and not stop():
            for key, _ in selector.select(SLICE):
                text = os.read(key.fd, 65536)
                if not text:
                    selector.unregister(key.fileobj)
                yield from text.decode().split()
    finally:
        for other in others:
            other.kill()
            other.wait()
        selector.close()


def _pipe(process: "subprocess.Popen[bytes]") -> IO[bytes]:
    assert process.stdout is not None
    return process.stdout


def serve(place: str) -> None:
    """Call functions in a process of its own, telling which kernels are compiled; ends with the process that asked.

    Args:
        place: "module:name:argument:..." of each, with a ";" between them.
    """
    from numba.core import event

    class Tell(event.Listener):
        def on_start(self, event: Any) -> None:
            """Nothing yet."""

        def on_end(self, event: Any) -> None:
            """Another kernel."""
            function = event.data["dispatcher"].py_func
            if function.__module__.startswith(("controller.", "sim.")):  # and none of Numba's own
                os.write(out, f"{function.__module__}.{function.__name__}\n".encode())

    out = os.dup(1)
    os.dup2(2, 1)  # what else is printed
    threading.Thread(target=_end_with_the_other, daemon=True).start()
    gc.set_threshold(YOUNG)
    event.register("numba:compile", Tell())
    for call in place.split(";"):
        module, name, *arguments = call.split(":")
        named(f"{module}:{name}")(*arguments)


def _end_with_the_other() -> None:
    sys.stdin.buffer.read()
    os._exit(1)


def settle() -> None:
    """Compile how C-MPC solves what a tick asks."""
    from controller.cmpc.cascade import compile_half
    from sim.bridge.run import build_controller, known_belief
    from sim.scenario import Scenario

    scenario = Scenario()
    law = build_controller(scenario.controller, known_belief(scenario.walker, scenario.gait))
    compile_half(law, "settle")


def look_ahead() -> None:
    """Compile what a tick of C-MPC does before it solves, and the plant it stands on."""
    from controller.cmpc.cascade import compile_half
    from sim.bridge.run import build_controller, build_plant, known_belief, start_state
    from sim.scenario import Scenario

    scenario = Scenario()
    belief = known_belief(scenario.walker, scenario.gait)
    compile_half(build_controller(scenario.controller, belief), "foresee")
    plant: Any = build_plant(scenario)
    plant.reset(*start_state(scenario, belief), LEGS[0])
    plant.observe()
    plant.hold(np.zeros(4))
    belief.model.swing_foot(*start_state(scenario, belief))
    room = Ticks.room(1)
    Judge(LEGS[0]).look(room.state, room.judged, 0)


def walk(kind: str, plant: str) -> None:
    """Walk a step under a law and a push that saturates it."""
    from sim.bridge.run import run_scenario
    from sim.scenario import Scenario, with_values

    push = {"pushes.0.force": 60.0, "pushes.0.step": 1}
    rigid = {"plant.kind": "rigid", "plant.timestep": 1e-3} if plant == "rigid" else {}
    run_scenario(with_values(Scenario(), {"controller.kind": kind, "steps": 1} | push | rigid), prepared=True)


def gaits() -> None:
    """Find the orbit of a gait and its eigenvalues."""
    from controller.belief import Gains
    from controller.design.orbit import periodic_orbit
    from controller.design.poincare import return_map
    from sim.bridge.run import known_belief
    from sim.scenario import Scenario

    scenario = Scenario()
    belief = known_belief(scenario.walker, "paper-polished")
    periodic_orbit(belief.model, belief.gait)
    gains = Gains(kp=np.array(scenario.controller.kp), kd=np.array(scenario.controller.kd))
    return_map(belief.model, belief.gait, gains)


def main() -> None:
    """Prepare what the first walks need, with a bar: for the installation."""
    from sim.terminal.progress import progress_bar

    if ready("c-mpc", "mujoco"):
        return
    with progress_bar("compiling kernels", quiet=False) as update:
        prepare("c-mpc", "mujoco", show=update or unseen)


if __name__ == "__main__":
    main()
