"""`cmpc new`: a scenario, a plan or a controller to start from."""

import os
import shlex
from argparse import Namespace
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from sim.commands.options import ESSENTIAL
from sim.errors import UserError
from sim.scenario import load
from sim.settings.commented import commented

PLAN = """
controllers = ["c-mpc", "zd-pd"]

[scenario]
steps = 10

[[grid]]
name = "how hard and how early"

[[grid.axes]]
paths = ["pushes.0.force"]
also = ["pushes.0.step = 2"]
low = 10.0
high = 50.0
count = 5

[[margin]]
name = "how heavy"

[[margin.axes]]
name = "mass of torso"
paths = ["plant.mass_factor.torso"]
nominal = 1.0
low = 0.5
high = 2.0
tolerance = 0.1
typical = 0.1

[[montecarlo]]
name = "both at once"
trials = 20

[[montecarlo.axes]]
paths = ["plant.mass_factor.torso"]
distribution = "uniform"
low = 0.8
high = 1.2
"""

CONTROLLER = '''"""A controller of one's own: hold the gait's posture joint by joint.

cmpc run --controller ./{name}
cmpc run --controller ./{name} --controller.settings.kp 400
"""

from dataclasses import dataclass
from typing import Annotated

from controller import POSITIVE, StanceEstimator, Unit


@dataclass(frozen=True)
class Settings:
    """What can be set: keys of [controller.settings], flags, axes of trials.

    Attributes:
        kp: Stiffness of each joint.
        kd: Damping of each joint.
    """

    kp: Annotated[float, Unit("N.m/rad"), POSITIVE] = 300.0
    kd: Annotated[float, Unit("N.m.s/rad"), POSITIVE] = 20.0


class Mine:
    def __init__(self, model, gait, settings: Settings):
        """Asked for by name: model, gait, period, kp, kd, horizon, friction, ..., and a dataclass of settings."""
        self.gait, self.settings, self.stance = gait, settings, StanceEstimator(model)

    def reset(self, stance):
        """The run begins; stance is "left" or "right"."""
        self.stance.reset(stance)

    def step(self, observation):
        """One tick: observation has t [s], q [rad], dq [rad/s] of four joints and the torso, and foot contacts."""
        state = self.stance.update(observation)  # joints by what they do now: stance leg first
        theta, dtheta = self.gait.clock @ state.q, self.gait.clock @ state.dq
        h, slope, _ = self.gait.desired(theta)
        y, dy = state.q[:4] - h, state.dq[:4] - slope * dtheta  # off the gait
        u = -self.settings.kp * y - self.settings.kd * dy  # [N.m]
        return state.leg.from_body(u)  # left hip, right hip, left knee, right knee


make = Mine
'''


def add_parser(commands: Any, argv: Sequence[str]) -> None:
    """Add the parser of `cmpc new`."""
    parser = commands.add_parser("new", description="Write a file to start from, with comments.")
    actions = parser.add_subparsers(metavar="COMMAND")
    kinds: tuple[tuple[str, str, str, Callable[[Namespace], str]], ...] = (
        ("scenario", "FILE.toml", "what happens in a run: every setting with its unit and what it may be", _scenario),
        ("plan", "FILE.toml", "many trials: a grid, a margin, a Monte-Carlo study", _plan),
        ("controller", "FILE.py", "a controller with settings of its own", _controller),
    )
    for name, file, text, write in kinds:
        action = actions.add_parser(name, help=text, description=f"Write a {name}: {text}.")
        action.add_argument("file", metavar=file, help="the file to write; one that is there stays as it is")
        if name == "scenario":
            action.add_argument("--from", dest="source", metavar="NAME|FILE.toml", help="take this one's values")
        action.set_defaults(run=_run, write=write, ending=file.removeprefix("FILE"))


def _run(found: Namespace) -> int:
    path = Path(found.file)
    if path.suffix != found.ending:
        raise UserError(f"{path}: must be a name that ends in {found.ending}")
    text = found.write(found)
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError:
        raise UserError(f"{path}: is there already and is never written over; choose another name") from None
    except OSError as error:
        raise UserError(f"{path}: cannot be written: {error.strerror}") from error
    where = found.file if os.sep in found.file else f"./{found.file}"
    then = {
        _scenario: f"cmpc run {shlex.quote(found.file)}",
        _plan: f"cmpc trials {shlex.quote(found.file)} --out {shlex.quote(f'{path.stem}-trials')}",
        _controller: f"cmpc run --controller {shlex.quote(where)}",
    }
    print(f"{path}\nnext: {then[found.write]}")
    return 0


def _scenario(found: Namespace) -> str:
    scenario = load(found.source or "push-25N")
    head = f"# A scenario, from {found.source or 'push-25N'}: cmpc run {found.file}\n"
    return head + _LEGEND + commented(scenario, lambda path: path in ESSENTIAL)


_LEGEND = """\
# Lines that begin with #key hold defaults: take the # away and change them. Units stand in brackets.

"""


def _plan(found: Namespace) -> str:
    from sim.trials.plan.plan import from_toml

    head = f"# A plan: cmpc trials {found.file} --out {Path(found.file).stem}-trials\n"
    live = ("controllers", "scenario.steps", "seed", "wall_limit")
    return (
        head
        + _LEGEND
        + "# Every key of a scenario may stand under [scenario]; cmpc new scenario shows them.\n\n"
        + commented(from_toml(PLAN), lambda path: path in live, without=lambda path: path.startswith("scenario."))
    )


def _controller(found: Namespace) -> str:
    return CONTROLLER.replace("{name}", Path(found.file).name)
