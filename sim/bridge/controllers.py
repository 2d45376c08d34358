"""What a controller believes, from a scenario's files, and the controller a scenario asks for."""

import functools

from controller import laws
from controller.laws import Belief
from controller.qp import Solver
from sim.interface import Controller
from sim.scenario import ControllerSettings, Scenario
from sim.walkers import ModelFiles


def load_belief(scenario: Scenario, files: ModelFiles | None = None) -> Belief:
    """The controller's model and gait.

    Args:
        scenario: What happens.
        files: Model files to use instead of those the scenario names.

    Raises:
        UserError: a file is missing, unreadable or not legal.
    """
    files = files or ModelFiles.of(scenario)
    return Belief.load(files.urdf, files.gait, files.library)


def known_belief(walker: str, gait: str) -> Belief:
    """The controller's model and gait, one of the last four or read anew: a campaign runs thousands of scenarios.

    Raises:
        UserError: a file is missing, unreadable or not legal.
    """
    files = ModelFiles.named(walker, gait)
    stats = [path.stat() for path in files.read if path.is_file()]
    return _read(files, tuple((stat.st_mtime_ns, stat.st_size, stat.st_ino) for stat in stats))


@functools.lru_cache(maxsize=4)
def _read(files: ModelFiles, stamps: tuple[tuple[int, ...], ...]) -> Belief:
    """A belief; the stamps are those of the files, so that edited ones are read again."""
    return Belief.load(files.urdf, files.gait, files.library)


def build_controller(settings: ControllerSettings, belief: Belief, *, solver: Solver | None = None) -> Controller:
    """The controller a scenario asks for; see `laws.build`."""
    return laws.build(settings, belief, solver=solver)
