"""The functions of the public face, which `import sim` hands on."""

import dataclasses
import functools
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

from controller.common import outside
from sim.bridge import limits
from sim.bridge.gaits import Requirements, design_gait
from sim.bridge.run import run_scenario
from sim.errors import UserError
from sim.log.read import read_log, salvage
from sim.log.read.attachments import scenario_of
from sim.loop import RunSummary
from sim.review import shown
from sim.review.page import write_page
from sim.review.replay import Verdict, rerun
from sim.review.replay import replay as replayed
from sim.review.shown import Log
from sim.scenario import Scenario, load, with_value, with_values
from sim.trials.plan import Plan, load_plan
from sim.trials.plan.plan import from_toml
from sim.trials.run import Results, run_plan

P = ParamSpec("P")
T = TypeVar("T")


def one_level(function: Callable[P, T]) -> Callable[P, T]:
    """Show a user's mistake as one error, without what led to it inside."""

    @functools.wraps(function)
    def asked(*args: P.args, **kwargs: P.kwargs) -> T:
        try:
            return function(*args, **kwargs)
        except UserError as error:
            raise error.with_traceback(None) from None

    return asked


@one_level
def run(scenario: Scenario | str, *, controller: Any = None, log: Path | str | None = None) -> RunSummary:
    """Run a scenario from start to end.

    Args:
        scenario: What happens; a `str` is the name of a shipped one, or the path of a .toml file.
        controller: Instead of the scenario's: a kind ("zd-pd", "./mine.py:make"), a factory, or an object with
            `reset(stance)` and `step(observation)`.
        log: MCAP file to write; None for no log. An existing file is never overwritten.

    Returns:
        How it ended, with its figures. What a controller does wrong is the outcome "error", not an exception.

    Raises:
        UserError: a file or a setting is not legal; one line that names it, its value and what it must be.
    """
    wanted = load(scenario) if isinstance(scenario, str) else scenario
    if controller is not None:
        wanted = with_value(wanted, "controller.kind", _kind(controller))
    return run_scenario(wanted, log=Path(log) if log is not None else None)


@one_level
def run_trials(
    plan: Plan | str,
    out: Path | str | None = None,
    *,
    controllers: Sequence[Any] | None = None,
    workers: int | None = None,
) -> Results:
    """Run a plan of many trials, or what is left of it.

    Args:
        plan: What to try; a `str` is the name of a shipped plan, the path of a .toml file, or TOML text.
        out: Folder of the results, made if missing; None keeps them in memory.
        controllers: Instead of the plan's: kinds or factories that other processes can import.
        workers: Processes on this machine; one a core by default.

    Raises:
        UserError: a plan is not legal, or the folder holds results of another one.
    """
    if isinstance(plan, str):
        plan = from_toml(plan) if "\n" in plan else load_plan(plan)
    if controllers is not None:
        plan = dataclasses.replace(plan, controllers=tuple(map(_kind, controllers)))
    for kind in plan.controllers:
        if kind.startswith("python:"):
            raise UserError(f"controller {kind}: other processes cannot import it; put it into a file and name that")
    return run_plan(plan, out, workers=workers)


@one_level
def read(path: Path | str) -> Log:
    """A log as frames: topic -> columns by dotted field name; in a notebook it shows itself.

    Args:
        path: The MCAP file.

    Raises:
        UserError: it cannot be read or is damaged.
    """
    return shown.read(path)


@one_level
def write_review(log: Path | str, page: Path | str, *, other: Path | str | None = None) -> None:
    """Make one page from a log, or from two for comparison.

    Args:
        log: An MCAP log.
        page: The HTML file to write.
        other: A second log.

    Raises:
        UserError: a log cannot be read, is of a format this program does not know or has nothing to show, or the page
            cannot be written.
    """
    write_page([salvage(path) for path in (log, other) if path is not None], Path(page))


@one_level
def replay(
    log: Path | str, changes: Mapping[str, Any] | None = None, *, controller: Any = None, out: Path | str | None = None
) -> Verdict | RunSummary:
    """Run a log again: as it was, or with a change.

    Args:
        log: An MCAP log.
        changes: New values by dotted path, `{"plant.ground.friction": 0.4}`; nothing for the run as it was.
        controller: Instead of the log's, as for `run`.
        out: Log of the changed run; None for none.

    Returns:
        As it was: a `Verdict`, whose `identical` says whether every tick agrees to the last bit. With a change: how the
        changed run ended.

    Raises:
        UserError: the log does not hold what it takes, or a setting is not legal.
    """
    known = read_log(log)
    new = dict(changes or {}) | ({"controller.kind": _kind(controller)} if controller is not None else {})
    if not new:
        return replayed(known)
    return rerun(known, with_values(scenario_of(known), new), Path(out) if out is not None else None)


@one_level
def design(
    walker: str = "rabbit", *, step_length: float, speed: float, out: Path | str, force: bool = False, **more: Any
) -> Path:
    """Design a gait: the cheapest that keeps the requirements, the same bytes every time.

    Args:
        walker: A shipped walker, or a folder.
        step_length: In [m].
        speed: In [m/s].
        out: The gait's .toml file.
        force: Whether to write over another file that is there.
        more: Further fields of `controller.design.requirements.Requirements`, such as `torque_share=0.8`.

    Returns:
        The file.

    Raises:
        UserError: no gait keeps the requirements; the message says which stand in the way and by how much.
    """
    request = {"step_length": step_length, "speed": speed, **more}
    _check_fields("design", request, Requirements)
    made, _ = design_gait(
        walker,
        request,
        degree=6,
        cost="torque",
        warm=None,
        starts=2,
        name=None,
        out=Path(out),
        force=force,
        say=lambda line: None,
    )
    return made.path


@one_level
def limit(
    axis: str,
    walker: str = "rabbit",
    gait: str = "paper-polished",
    *,
    step: int | None = None,
    seconds: float | None = None,
    **more: Any,
) -> limits.Answer:
    """How much of a disturbance any controller could hold: a local optimum, as `cmpc limit` searches it.

    Args:
        axis: What disturbs, such as "push-back"; `cmpc limit --help` lists them.
        walker: A shipped walker, or a folder.
        gait: Name or file of its gait.
        step: Step that is disturbed; None for the axis' usual one.
        seconds: Duration of a push in [s]; None for that of the step.
        more: Further fields of `controller.limit.question.Question`, such as `friction=0.6` or `starts=5`.

    Returns:
        Its `value` is in [N], [N.s], [rad], [m] or a ratio (`question.what.unit`); `sure` says how sure it is.

    Raises:
        UserError: the question is not legal, no walk is found, or the extra "design" is not installed.
    """
    _check_fields("limit", more, limits.Question)
    return limits.ask(
        limits.Question(axis=axis, step=limits.usual_step(axis) if step is None else step, seconds=seconds, **more),
        walker,
        gait,
    )


def _check_fields(what: str, given: Mapping[str, Any], of: type) -> None:
    """Refuse keywords that are no fields of a dataclass."""
    legal = [field.name for field in dataclasses.fields(of)]
    unknown = set(given) - set(legal)
    if unknown:
        raise UserError(f"{what}: {', '.join(sorted(unknown))}: unknown; must be of {', '.join(legal)}")


def _kind(controller: Any) -> str:
    return controller if isinstance(controller, str) else outside.give(controller)
