"""Runs a log again from itself alone, and compares every tick."""

import dataclasses
import json
import tempfile
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path

from sim.bridge.run import Announce, prepare, run_scenario
from sim.errors import UserError
from sim.log import provenance
from sim.log.read import Log, read_log
from sim.log.read.attachments import scenario_of, unpacked
from sim.log.read.frames import parsed
from sim.log.tools.check import changed_attachments
from sim.log.tools.compare import MEASURED, SINCE, Comparison, compare
from sim.log.tools.signed import signature_problems
from sim.loop import Outcome, Progress, RunSummary, Stop
from sim.scenario import Scenario
from sim.walkers import ModelFiles


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Verdict:
    """Whether a run came out the same.

    Attributes:
        comparison: The log against the new run.
        changed: What is not as the run left it, attachments or anything signed; a sentence each.
        attachments: Attachments that the new run does not have so; a scenario that reads the same is the same.
        figures: Names of figures of the summary that differ.
        ticks: Ticks of the log.
        whole: Whether the log has the end of its run; without it the new run is compared as far as the log goes.
    """

    comparison: Comparison
    changed: tuple[str, ...]
    attachments: tuple[str, ...]
    figures: tuple[str, ...]
    ticks: int
    whole: bool

    @property
    def agrees(self) -> bool:
        """Whether nothing that is in the log differs."""
        channels = self.comparison.channels
        same = bool(channels) and all(c.equal for c in channels) and not self.attachments
        return same and not self.changed and not self.figures and self.ticks > 0

    @property
    def identical(self) -> bool:
        """Whether the log is whole and every tick, event, attachment and figure agrees to the last bit."""
        return self.agrees and self.whole and self.comparison.sound


_MACHINE = {"cpu": "the processor", "blas": "the kernel of the BLAS", "kernels": "the digest of the compiled kernels"}


def version_changes(log: Log) -> list[str]:
    """What differs between the program that wrote a log and this one, a sentence each."""
    run = log.metadata.get("run", {})
    then, now = parsed(run.get("versions", "{}")), provenance.package_versions()
    then = then if isinstance(then, dict) else {}
    found = [
        f"{name} was {then.get(name, 'not there')}, is {now.get(name, 'not there')}"
        for name in sorted({*then, *now})
        if then.get(name) != now.get(name)
    ]
    for name, now_here in (provenance.machine() if "cpu" in run else {}).items():
        if run.get(name) != now_here:
            found.append(f"{_MACHINE[name]} was {run.get(name, 'not told')}, is {now_here}")
    git = provenance.git_state()
    if run.get("git_revision") and git.revision and run["git_revision"] != git.revision:
        found.append(f"the program was at revision {run['git_revision'][:12]}, is at {git.revision[:12]}")
    elif run.get("git_dirty") == "true" or git.dirty:
        found.append("the program had or has changes that are under no revision")
    return found


def replay(log: Log, *, progress: Progress | None = None, announce: Announce | None = None) -> Verdict:
    """Run a log again as it was and compare.

    Args:
        log: A sound log; it may stop in the middle.
        progress: Told now and then the completed steps and the simulated time in [s].
        announce: Told a line for the user before something long.

    Raises:
        UserError: the log does not hold what it takes.
    """
    scenario = scenario_of(log)
    ticks = len(log.channel("/plant/state")) if "/plant/state" in log.channels else 0
    result = log.metadata.get("result", {})
    whole = log.complete and "recovery" not in log.metadata and "result" in log.metadata
    reason = result.get("message", "") if result.get("outcome") == Outcome.INTERRUPTED.value else "the log ends here"
    with tempfile.TemporaryDirectory(prefix="cmpc-") as folder, unpacked(scenario, log.attachments) as files:
        again = Path(folder) / "again.mcap"
        failure = ""
        summary: RunSummary | None = None
        prepare(scenario, announce=announce)  # before the run, whose wish to stop counts ticks
        stop = _after(ticks, reason)
        try:
            summary = run_scenario(scenario, log=again, progress=progress, stop=stop, files=files, prepared=True)
        except UserError:
            raise
        except Exception as error:  # the run may have ended in this error; its log tells
            failure = f"{type(error).__name__}: {error}"
        if not again.exists():
            raise UserError(f"{log.path} cannot be run again: {failure}")
        new = read_log(again)
        comparison = compare(log, new, last_tick=None if whole else ticks - 1)
        same = "scenario.toml" in new.attachments and scenario_of(new) == scenario
    return Verdict(
        comparison=comparison,
        changed=(*_changed(log), *(signature_problems(log) if whole else ())),
        attachments=tuple(name for name in comparison.attachments if not (same and name == "scenario.toml")),
        figures=_figures(result, summary) if whole else (),
        ticks=ticks,
        whole=whole,
    )


def rerun(
    log: Log,
    changed: Scenario,
    target: Path | None,
    *,
    progress: Progress | None = None,
    stop: Stop | None = None,
    announce: Announce | None = None,
) -> RunSummary:
    """Run the situation of a log with a change, into a new log.

    Args:
        log: A sound log.
        changed: Its scenario with something changed.
        target: The new log; None for none.
        progress: Told now and then the completed steps and the simulated time in [s].
        stop: Asked every tick; a reason ends the run as interrupted.
        announce: Told a line for the user before something long.

    Raises:
        UserError: the log does not hold what it takes, or a setting is not legal.
    """
    before = scenario_of(log)
    own_files = (changed.walker, changed.gait) == (before.walker, before.gait)
    with unpacked(before, log.attachments) if own_files else nullcontext(ModelFiles.of(changed)) as files:
        return run_scenario(changed, log=target, progress=progress, stop=stop, announce=announce, files=files)


def _after(ticks: int, reason: str) -> Callable[[], str | None]:
    """Stop a run that goes on longer than the log."""
    asked = 0

    def stop() -> str | None:
        nonlocal asked
        asked += 1
        return reason if asked > ticks else None

    return stop


def _changed(log: Log) -> list[str]:
    digests = parsed(log.metadata.get("run", {}).get("sha256", "null"))
    if not isinstance(digests, dict) or not digests:
        return ["the log has no digests of its attachments"]
    return changed_attachments(log, {str(name): str(digest) for name, digest in digests.items()})


def _figures(logged: dict[str, str], summary: RunSummary | None) -> tuple[str, ...]:
    """Figures of the summary that differ, wall times left out."""
    if summary is None:
        return ("outcome",)
    now = {k: v if isinstance(v, str) else json.dumps(v) for k, v in dataclasses.asdict(summary).items()}
    ignored = {*MEASURED, *(name for name in SINCE if name not in logged)}
    return tuple(name for name, text in now.items() if name not in ignored and logged.get(name) != text)
