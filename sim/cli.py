"""The program `cmpc`: finds the sub-command and turns errors into one line and an exit code.

A sub-command is a module of `sim.commands` with `add_parser(commands, argv)`, imported when it is called, and a line
in `COMMANDS`. It adds its parser and gives it, as the default of `run`, what the parsed words are handed to.
"""

import atexit
import importlib
import os
import signal
import sys
from collections.abc import Sequence

from sim.errors import UserError
from sim.terminal.interrupt import hearing_ctrl_c
from sim.terminal.output import with_output
from sim.terminal.pulse import PULSE

COMMANDS = {
    "run": "Run one scenario, show its summary and leave a log.",
    "gait": "Design gaits, check them, polish printed ones, fill the library.",
    "gains": "Search the gains of ZD+PD by the Poincare map's eigenvalues.",
    "weights": "Search the weights and the horizon of C-MPC on a robustness score.",
    "walker": "Start a folder for a walker of one's own from its URDF, and check it end to end.",
    "log": "Look at logs: info, check, recover, export, compare.",
    "replay": "Run a log again from itself, as it was or with a change.",
    "review": "Make one page from a log, or from two.",
    "video": "Make a film or a picture from a log.",
    "reproduce": "The paper's figures and tables again, with a verdict for each claim.",
    "poincare": "Fixed point and eigenvalues of the step-to-step map.",
    "basin": "Basins of attraction of a controller and of ZD+PD over torso offset and first-step force.",
    "limit": "How much any controller could hold: optimal control that knows all beforehand.",
    "bench": "Measure ticks, solves and runs on this machine against their targets.",
    "trials": "Run a plan of many trials: grids, margins, Monte-Carlo; leave a database and a page.",
    "new": "Write a scenario, a plan or a controller to start from, with comments.",
    "doctor": "Say what is installed, what is missing, and what the machine can do.",
    "completion": "Print the completion of commands and options for a shell.",
}

FIRST = """\
first
  cmpc run                                     RABBIT walks; 25 N push it in step 2
  cmpc run push-40N-first --controller zd-pd   without the MPC: it falls, and says why
  cmpc review RUN.mcap                         a run as a page: animation, plots, events
  cmpc trials pushes --out campaigns/pushes    how much does it hold? hundreds of runs, one page

your own
  cmpc new controller mine.py                  then: cmpc run --controller ./mine.py
  cmpc new scenario mine.toml                  then: cmpc run mine.toml
  cmpc walker new my-biped --urdf FILE.urdf    any five-link biped as published

cmpc COMMAND --help shows a command's options; cmpc doctor says whether something is missing.
"""

EXIT_USER_ERROR = 2
EXIT_INTERRUPTED = 130


def entry_point() -> None:
    """Console script `cmpc`."""
    code = with_output(_all_but_the_end)
    if code != EXIT_INTERRUPTED:
        sys.exit(code)
    # Python would end itself by the signal where Ctrl-C met code that a library runs, and lose the exit code.
    atexit._run_exitfuncs()
    sys.stderr.flush()
    os._exit(code)


def _all_but_the_end() -> int:
    code = main(sys.argv[1:])
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # all is done, and Python on its way out would end by the signal
    return code


def main(argv: Sequence[str]) -> int:
    """Run one command line.

    Args:
        argv: Words after the program's name.

    Returns:
        Exit code, as `docs/exit-codes.md` lists them.
    """
    try:
        with hearing_ctrl_c():
            return _run(argv)
    except UserError as error:
        print("cmpc: error:", " ".join(str(error).split()), file=sys.stderr)
        return EXIT_USER_ERROR
    except OSError as error:
        if error.filename is None:
            raise
        print(f"cmpc: error: {error.filename}: {error.strerror}", file=sys.stderr)
        return EXIT_USER_ERROR
    except KeyboardInterrupt:
        print("cmpc: interrupted", file=sys.stderr)
        return EXIT_INTERRUPTED


def _run(argv: Sequence[str]) -> int:
    from sim.settings.flags import Parser

    parser = Parser(
        prog="cmpc",
        usage="cmpc COMMAND [options]",
        description="Cascaded MPC for the five-link biped RABBIT, walking in MuJoCo.",
        epilog=FIRST,
    )
    parser.add_argument("--version", action="store_true", help="print the version")
    commands = parser.add_subparsers(title="commands", metavar="", prog="cmpc")
    for name, line in COMMANDS.items():
        if [name] == list(argv[:1]):  # only the one that is asked for, so that nothing else is loaded
            importlib.import_module(f"sim.commands.{name}").add_parser(commands, argv[1:])
        else:
            commands.add_parser(name, help=line)
    if not argv:
        print(f"{parser.description}\n\n{FIRST}\ncommands")
        for name, line in COMMANDS.items():
            print(f"  {name:<12}{line}")
        return 0
    try:
        found = parser.parse(argv)
    except SystemExit:  # --help
        return 0
    if found.version:
        from importlib.metadata import version

        print("cmpc", version("cmpc-walker"))
        return 0
    if "run" not in found:
        found.parser.print_help()
        return 0
    silent = getattr(found, "quiet", False) or getattr(found, "json", False)
    with PULSE.hushed() if silent else PULSE.beating(found.parser.prog):
        return int(found.run(found))
