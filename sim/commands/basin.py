"""`cmpc basin`: from which torso offsets and first-step forces ZD+PD and C-MPC come back."""

import json
import os
import sys
from collections.abc import Sequence
from pathlib import Path

from sim.errors import UserError
from sim.scenario import Scenario, load, to_toml, with_value
from sim.settings import flags
from sim.terminal.interrupt import stop_on_signal

DEFAULT = "undisturbed"
OUT = Path("logs/basin")
TORSO = (-0.8, 0.8, 9.0)  # [rad], [rad], number
FORCE = (-40.0, 80.0, 7.0)  # [N], [N], number

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


def main(argv: Sequence[str]) -> int:
    """Run `cmpc basin`; returns the exit code."""
    found = _parser(Scenario(), argv).parse(argv)
    scenario = load(found.scenario)
    if found.help:
        _parser(scenario, argv).print_help()
        return 0
    scenario = flags.apply(scenario, found)
    torso, force = _axis("--torso", found.torso, "rad"), _axis("--force", found.force, "N")
    if not found.epsilon > 0.0:
        raise UserError(f"--epsilon {found.epsilon:g} rad: must be above 0 [rad]")
    for name, value in (("--limit", found.limit), ("--workers", found.workers)):
        if value < 1:
            raise UserError(f"{name} {value}: must be 1 or above")
    return _map(
        scenario,
        torso,
        force,
        axis=found.axis,
        epsilon=found.epsilon,
        limit=found.limit,
        out=Path(found.out),
        workers=found.workers,
        quiet=found.quiet,
    )


def _parser(scenario: Scenario, argv: Sequence[str]) -> flags.Parser:
    parser = flags.Parser(
        prog="cmpc basin",
        usage="cmpc basin [NAME|FILE.toml] [options]",
        description="Basin of attraction of both controllers over torso offset and first-step force.",
        epilog=EPILOG,
    )
    text = f"a shipped scenario (cmpc run --list) or a scenario file (default: {DEFAULT})"
    parser.add_argument("scenario", nargs="?", default=DEFAULT, metavar="NAME|FILE.toml", help=text)
    own = parser.add_argument_group("options")
    own.add_argument("-h", "--help", action="store_true", help="show the options, with the scenario's values")
    span = ("FIRST", "LAST", "NUMBER")
    text = "torso offsets [rad] (default: -0.8 0.8 9)"
    own.add_argument("--torso", nargs=3, type=float, default=TORSO, metavar=span, help=text)
    text = "forces [N] (default: -40 80 7)"
    own.add_argument("--force", nargs=3, type=float, default=FORCE, metavar=span, help=text)
    text = "what the offset turns (default: torso)"
    own.add_argument("--axis", choices=("torso", "q5"), default="torso", help=text)
    text = "distance from the periodic state that counts as converged (default: 0.05)"
    own.add_argument("--epsilon", type=float, default=0.05, metavar="rad", help=text)
    own.add_argument("--limit", type=int, default=25, metavar="STEPS", help="most steps of a run (default: 25)")
    own.add_argument("--out", default=str(OUT), metavar="FOLDER", help=f"folder for results (default: {OUT})")
    text = "worker processes (default: one for each core)"
    own.add_argument("--workers", type=int, default=os.cpu_count() or 1, metavar="INT", help=text)
    own.add_argument("--quiet", action="store_true", help="show no progress")
    flags.add_settings(parser, scenario, argv)
    return parser


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
    from sim.reproduce import draw, report, tasks
    from sim.reproduce.basin import Fate, Grid
    from sim.reproduce.experiments import fig8
    from sim.reproduce.study import CONTROLLER_NAMES, CONTROLLERS, PLANT_NAMES, Task
    from sim.terminal.bar import cost_bar

    draw.require()
    grid = Grid.of(torso, force)
    store = tasks.Store(out / "tasks")
    wanted = {}
    for controller in CONTROLLERS:
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
                cost=3.0 if controller == "c-mpc" else 1.0,
            )
    with stop_on_signal() as stop, cost_bar("mapping", quiet=quiet) as show:
        try:
            tasks.run(wanted, store, workers=workers, progress=show, stop=stop)
        except tasks.Stopped as reason:
            print(f"cmpc: {reason}; run the same command again to go on", file=sys.stderr)
            return 128 + stop.signum
    results = {name: store.get(task) or {} for name, task in wanted.items()}
    zd, mpc = inside = [fig8.converged(results, "", controller, grid) for controller in CONTROLLERS]
    panel = fig8.panel(zd, mpc, grid, title=f"{scenario.name}, {PLANT_NAMES[scenario.plant.kind]}")
    draw.draw(((panel,),), "Basins of attraction", out / "basin.png")
    report.write_csv(out / "basin.csv", fig8.table(results, "", grid))
    areas = {
        controller: float(members.sum()) * grid.cell for controller, members in zip(CONTROLLERS, inside, strict=True)
    }
    (out / "basin.json").write_text(json.dumps({"area [rad N]": areas, "epsilon [rad]": epsilon}) + "\n")
    for controller, area in areas.items():
        fates = [int(fate) for i in range(len(grid.torso)) for fate in results[f"{controller}/{i}"]["fate"]]
        counts = ", ".join(f"{fates.count(fate)} {fate.name.lower()}" for fate in Fate)
        print(f"{CONTROLLER_NAMES[controller]:<6} {area:8.2f} rad N   {counts}")
    print(f"map: {out / 'basin.png'}\ndata: {out / 'basin.csv'}", flush=True)
    return 0
