"""`cmpc reproduce`: the paper's figures and tables again, on both plants, with a verdict for each claim."""

import importlib
import math
import sys
from argparse import Namespace
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from controller.common import outside
from controller.common.settings import BUILT_IN
from sim.commands.options import add_quiet, add_workers, with_controller
from sim.errors import UserError
from sim.reproduce import EXPERIMENTS
from sim.scenario import Scenario, with_values
from sim.settings import flags
from sim.terminal import console
from sim.terminal.interrupt import stop_on_signal
from sim.terminal.progress import progress_bar
from sim.walkers import ModelFiles

OWN = ("name", "plant.kind", "steps")
"""Settings of the experiments' own, which a flag would change in vain, or under a column's name."""

OUT, OUT_QUICK = Path("logs/reproduce"), Path("logs/reproduce-quick")
WIDTH = 200  # columns of a table that goes to a file

EPILOG = """\
Results are kept in the output folder: an interrupted reproduction goes on where it stopped, and one whose inputs
did not change does nothing again. A setting given as a flag is changed in every run, so that one can ask what a
claim hangs on; --out then keeps the results apart:

  cmpc reproduce all
  cmpc reproduce fig4 table2 --quick
  cmpc reproduce fig5 --controller.kp 0 0 0 0 --out logs/without-kp

exit code: 0 done, whatever the verdicts; 2 bad input; 130 and 143 interrupted by Ctrl-C and SIGTERM
"""


def add_parser(commands: Any, argv: Sequence[str]) -> None:
    """Add the parser of `cmpc reproduce`."""
    parser = commands.add_parser(
        "reproduce",
        usage="cmpc reproduce [all|EXPERIMENT ...] [options]",
        description="The paper's figures and tables again, on its own kind of plant and on MuJoCo.\n\nexperiments:\n"
        + "\n".join(f"  {name:<10}{title}" for name, title in EXPERIMENTS.items()),
        epilog=EPILOG,
    )
    parser.set_defaults(run=_run)
    text = "what to reproduce (default: all)"
    parser.add_argument("experiments", nargs="*", metavar="EXPERIMENT", help=text)
    own = parser.add_argument_group("own options")
    own.add_argument("--quick", action="store_true", help="coarse versions, in about two minutes")
    text = f"folder for results (default: {OUT}, with --quick {OUT_QUICK})"
    own.add_argument("--out", metavar="FOLDER", help=text)
    add_workers(own)
    add_quiet(own)
    flags.add_settings(parser, with_controller(Scenario(), argv), argv)


def _run(found: Namespace) -> int:
    names = _names(found.experiments)
    changes = flags.changes(Scenario(), found)
    _check(changes)
    out = Path(found.out) if found.out is not None else OUT_QUICK if found.quick else OUT
    return _reproduce(names, out, changes, quick=found.quick, workers=found.workers, silent=found.quiet)


def _names(given: Sequence[str]) -> list[str]:
    for name in given:
        if name != "all" and name not in EXPERIMENTS:
            guess = flags.nearest(name, EXPERIMENTS)
            raise UserError(f"no experiment {name!r}; {guess}There are: all, {', '.join(EXPERIMENTS)}")
    return [name for name in EXPERIMENTS if not given or "all" in given or name in given]


def _check(changes: Mapping[str, Any]) -> None:
    """Refuse what the experiments set themselves.

    Raises:
        UserError: names the flag.
    """
    for path in OWN:
        if path in changes:
            raise UserError(f"--{path} {changes[path]}: is set by each experiment; must be left out")
    if changes.get("controller.kind") == "zd-pd":
        raise UserError("--controller zd-pd: is what every controller is compared with; must be another one")


def _reproduce(
    names: Sequence[str], out: Path, changes: Mapping[str, Any], *, quick: bool, workers: int, silent: bool
) -> int:
    from sim.reproduce import report
    from sim.reproduce.study import Effort, Evaluation, evaluation_of, tasks_of
    from sim.runner import Stopped, TaskStore, run_tasks

    store = TaskStore(out / "tasks")
    effort = Effort(quick=quick, changes=changes)
    modules = {name: importlib.import_module(f"sim.reproduce.experiments.{name}") for name in EXPERIMENTS}

    def files(name: str) -> tuple[str, ...]:
        """What a task reads; its name begins with its gait."""
        gait = {} if "gait" in changes else {"gait": name.partition("/")[0]}
        changed = with_values(Scenario(), {**changes, **gait})
        kind = changed.controller.kind
        law = outside.source_of(kind)[0] if kind not in BUILT_IN else None
        return tuple(str(path) for path in (*ModelFiles.of(changed).read, *([law] if law else [])))

    wanted = {
        name: {key: replace(task, files=files(key)) for key, task in tasks_of(module, effort).items()}
        for name, module in modules.items()
    }
    everything = {f"{name}:{key}": task for name in names for key, task in wanted[name].items()}
    open_tasks = {name: len(wanted[name]) for name in names}
    done: dict[str, Evaluation] = {}

    def evaluate(name: str) -> Evaluation | None:
        """What an experiment found, None if a result is missing."""
        results = {key: store.get(task) for key, task in wanted[name].items()}
        known = {key: found for key, found in results.items() if found is not None}
        return evaluation_of(modules[name], known, effort) if len(known) == len(results) else None

    def finished(task: str) -> None:
        name = task.partition(":")[0]
        open_tasks[name] -= 1
        if open_tasks[name]:
            return
        found = evaluate(name)
        if found is None:
            raise UserError(f"{store.folder}: a result of {name} that was just written cannot be read")
        done[name] = found
        report.write(name, found, out, quick=quick, changes=changes)

    with stop_on_signal() as stop, progress_bar("reproducing", quiet=silent) as show:
        try:
            run_tasks(everything, store, workers=workers, progress=show, finished=finished, stop=stop)
        except Stopped as reason:
            print(f"cmpc: {reason}; run the same command again to go on", file=sys.stderr)
            return 128 + stop.signum
    _print_verdicts({name: done[name] for name in names})
    # The page has whatever is complete in the folder, not only what was asked for this time.
    complete = {name: done.get(name) or evaluate(name) for name in EXPERIMENTS}
    shown = {name: found for name, found in complete.items() if found is not None}
    for name in shown.keys() - done.keys():
        report.write(name, shown[name], out, quick=quick, changes=changes)
    page = report.write_page(shown, out, quick=quick, changes=changes)
    _print_times({name: [store.cpu(task) for task in wanted[name].values()] for name in names})
    print(f"\npage: {page}\ndata: {out / 'data'}", flush=True)
    return 0


def _print_times(seconds: Mapping[str, Sequence[float]]) -> None:
    """CPU time of each experiment's runs; one that several ask for counts for each."""
    known = {name: sum(one for one in times if math.isfinite(one)) for name, times in seconds.items()}
    words = ", ".join(f"{name} {time:.0f}" for name, time in known.items())
    print(f"\nCPU time of the runs [s], {sum(known.values()):.0f} in all: {words}")


def _print_verdicts(found: Mapping[str, Any]) -> None:
    from rich.text import Text

    table = console.table(
        "experiment", "claim", "paper", "rigid plant", "MuJoCo", "holds", "rigid, polished", "MuJoCo, polished"
    )
    words = {True: ("yes", "green"), False: ("no", "red"), None: ("-", "dim")}
    for name, evaluation in found.items():
        for number, verdict in enumerate(evaluation.verdicts):
            findings = (verdict.rigid, verdict.mujoco)
            holds = Text(" / ").join(Text(*words[finding.holds]) for finding in (*findings, *(verdict.polished or ())))
            texts = [
                Text(finding.text, style="red" if finding.holds is False else "")
                for finding in (*findings, *(verdict.polished or ()))
            ]
            claim = (name if number == 0 else "", Text(verdict.claim), Text(verdict.paper))
            table.add_row(*claim, *texts[:2], holds, *texts[2:])
        table.add_section()
    console.show(table, WIDTH)
