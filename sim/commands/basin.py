"""`cmpc basin`: from which torso offsets and first-step forces a controller and ZD+PD come back."""

import json
import sys
from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from controller.common import outside
from controller.common.settings import BUILT_IN
from sim import pages
from sim.commands.options import add_quiet, add_scenario, add_workers, scenario_of
from sim.errors import UserError
from sim.scenario import Scenario, to_toml, with_value
from sim.settings import flags
from sim.terminal.interrupt import stop_on_signal
from sim.walkers import ModelFiles

DEFAULT = "undisturbed"
REFERENCE = "zd-pd"  # whose basin stands beside that of the scenario's controller
OUT = Path("logs/basin")
TORSO = (-0.8, 0.8, 9.0)  # [rad], [rad], number
FORCE = (-40.0, 80.0, 7.0)  # [N], [N], number

DESCRIPTION = "Basins of attraction of a controller and of ZD+PD over torso offset and first-step force."
EPILOG = """\
The first state is offset in the torso angle, and a horizontal force pushes the torso throughout the first step; the
scenario's own pushes and offsets play no part. --axis torso tilts the torso about the hip, --axis q5 the whole
walker about its stance foot. Results are kept: an interrupted map goes on where it stopped.

  cmpc basin
  cmpc basin --plant.kind rigid --torso -0.8 0.8 25 --force -40 80 31
  cmpc basin payload-x2 --out logs/basin-payload

writes basin.png, basin.csv (fates: 0 fell, 1 converged, 2 undecided) and basin.json with the areas
exit code: 0 done, 2 bad input, 130 and 143 interrupted by Ctrl-C and SIGTERM
"""


def add_parser(commands: Any, argv: Sequence[str], scenario: Scenario | None = None) -> None:
    """Add the parser of `cmpc basin`, whose help shows a scenario's values."""
    parser, own = add_scenario(
        commands, "basin", argv, scenario, description=DESCRIPTION, epilog=EPILOG, default=DEFAULT
    )
    parser.set_defaults(run=_run)
    for flag, unit, span in (("--torso", "rad", TORSO), ("--force", "N", FORCE)):
        text = f"[{unit}] (default: {' '.join(f'{value:g}' for value in span)})"
        own.add_argument(flag, nargs=3, type=flags.real(), default=span, metavar=("FIRST", "LAST", "NUMBER"), help=text)
    text = "what the offset turns (default: torso)"
    own.add_argument("--axis", choices=("torso", "q5"), default="torso", help=text)
    text = "distance from the periodic state that counts as converged (default: 0.05)"
    own.add_argument("--epsilon", type=flags.real(above=0.0), default=0.05, metavar="rad", help=text)
    text = "longest run (default: 25)"
    own.add_argument("--limit", type=flags.whole(1), default=25, metavar="STEPS", help=text)
    own.add_argument("--out", default=str(OUT), metavar="FOLDER", help=f"folder for results (default: {OUT})")
    add_workers(own)
    add_quiet(own)


def _run(found: Namespace) -> int:
    scenario = scenario_of(found, DEFAULT, add_parser)
    if scenario is None:
        return 0
    return _map(
        scenario,
        _axis("--torso", found.torso, "rad"),
        _axis("--force", found.force, "N"),
        axis=found.axis,
        epsilon=found.epsilon,
        limit=found.limit,
        out=Path(found.out),
        workers=found.workers,
        quiet=found.quiet,
    )


def _axis(flag: str, values: Sequence[float], unit: str) -> tuple[float, float, int]:
    first, last, number = values
    if not (last > first and number == int(number) and number >= 2):
        shown = " ".join(f"{value:g}" for value in values)
        raise UserError(f"{flag} {shown} [{unit}]: must be FIRST below LAST and a whole NUMBER of 2 or above")
    return first, last, int(number)


def _map(
    scenario: Scenario,
    torso: tuple[float, float, int],
    force: tuple[float, float, int],
    *,
    axis: str,
    epsilon: float,
    limit: int,
    out: Path,
    workers: int,
    quiet: bool,
) -> int:
    import numpy as np

    from sim.reproduce import draw, report
    from sim.reproduce.basin import Fate, Grid
    from sim.reproduce.experiments import fig8
    from sim.reproduce.study import CONTROLLER_NAMES, PLANT_NAMES
    from sim.runner import Stopped, Task, TaskStore, run_tasks
    from sim.terminal.progress import progress_bar

    grid = Grid.of(torso, force)
    store = TaskStore(out / "tasks")
    files = tuple(str(path) for path in ModelFiles.of(scenario).read)
    wanted = {}
    law = scenario.controller.kind if scenario.controller.kind != REFERENCE else "c-mpc"
    if law not in BUILT_IN:
        file, _ = outside.source_of(law)
        files += (str(file),) if file else ()
    for controller in (REFERENCE, law):
        text = to_toml(with_value(scenario, "controller.kind", controller))
        for i, offset in enumerate(grid.torso.tolist()):
            wanted[f"{controller}/{i}"] = Task(
                function="sim.reproduce.basin:column",
                arguments={
                    "scenario": text,
                    "axis": axis,
                    "torso": offset,
                    "force": grid.force.tolist(),
                    "epsilon": epsilon,
                    "steps": limit,
                },
                cost=1.0 if controller == REFERENCE else 3.0,
                files=files,
            )
    with stop_on_signal() as stop, progress_bar("mapping", quiet=quiet) as show:
        try:
            run_tasks(wanted, store, workers=workers, progress=show, stop=stop)
        except Stopped as reason:
            print(f"cmpc: {reason}; run the same command again to go on", file=sys.stderr)
            return 128 + stop.signum
    found = {}
    for controller in (REFERENCE, law):
        columns = [store.get(wanted[f"{controller}/{i}"]) or {} for i in range(len(grid.torso))]
        found[controller] = {what: np.array([one[what] for one in columns]).T for what in ("fate", "steps", "scuff")}
    labels = {controller: CONTROLLER_NAMES.get(controller, controller) for controller in found}
    inside = {controller: one["fate"] == Fate.CONVERGED for controller, one in found.items()}
    title = f"{scenario.name}, {PLANT_NAMES[scenario.plant.kind]}"
    panel = fig8.panel(inside[REFERENCE], inside[law], grid, title=title, name=labels[law])
    draw.draw(((panel,),), "Basins of attraction", out / "basin.png")
    report.write_csv(out / "basin.csv", fig8.table(found, grid))
    areas = {controller: float(members.sum()) * grid.cell for controller, members in inside.items()}
    pages.write(out / "basin.json", json.dumps({"area [rad N]": areas, "epsilon [rad]": epsilon}) + "\n")
    for controller, area in areas.items():
        fates = found[controller]["fate"].ravel().tolist()
        counts = ", ".join(f"{fates.count(fate)} {fate.name.lower()}" for fate in Fate)
        print(f"{labels[controller]:<10} {area:8.2f} rad N   {counts}")
    if areas[REFERENCE] > 0.0:
        print(f"{labels[law]}'s is {areas[law] / areas[REFERENCE]:.2f} times {labels[REFERENCE]}'s")
    print(f"map: {out / 'basin.png'}\ndata: {out / 'basin.csv'}", flush=True)
    return 0
