"""`cmpc limit`: how much any controller could hold."""

import json
from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from sim.commands.options import add_json, add_quiet
from sim.commands.run import check_new_log
from sim.errors import UserError
from sim.settings import flags
from sim.terminal import console
from sim.terminal.interrupt import stop_on_signal

DESCRIPTION = """\
How much of a disturbance could be survived by anybody: optimal control that knows all beforehand, on the walker's own
model, with torque limits, friction cone and ground contact hard; the disturbance itself is maximised.
"""
EPILOG = """\
  push-back, push-forward         force on the torso through a step [N], or for a time (--for)
  impulse-back, impulse-forward   impulse on the torso at the start of a step [N.s]
  slope-down, slope-up            constant slope, for a periodic walk [rad]
  step-down, step-up              a ledge, its place chosen [m]
  load                            factor on the torso's mass and inertia
  friction                        least friction on which a periodic walk exists

A walk starts in the gait's state after impact and ends in its state before impact. What is found is a local optimum:
there may be better ones, and no controller need reach it. Extra "design".

  cmpc limit push-back
  cmpc limit push-forward --for 0.5 --starts 5
  cmpc limit push-back --blind 0.1 --controller zd-pd     100 ms of ZD+PD under the push, then all is known
  cmpc limit push-back --log limit.mcap                   the walk of nine tenths of it or less, on the rigid plant
  cmpc limit --all --out limits.toml                      every axis; limits = "limits.toml" in a plan of trials;
                                                          the same command again goes on where it was interrupted
  cmpc limit push-back --step 2 --out limits.toml         one more row in it
"""
ALL: tuple[tuple[str, int], ...] = (
    ("push-back", 1),
    ("push-forward", 1),
    ("push-back", 2),
    ("push-forward", 2),
    ("impulse-back", 1),
    ("impulse-forward", 1),
    ("impulse-back", 2),
    ("impulse-forward", 2),
    ("slope-down", 1),
    ("slope-up", 1),
    ("step-down", 2),
    ("step-up", 2),
    ("load", 1),
    ("friction", 1),
)
"""Axis and step of `--all`."""


def add_parser(commands: Any, argv: Sequence[str]) -> None:
    """Add the parser of `cmpc limit`."""
    parser = commands.add_parser("limit", description=DESCRIPTION, epilog=EPILOG)
    parser.set_defaults(run=_run)
    parser.add_argument("axis", nargs="?", metavar="AXIS", help="of those below")
    parser.add_argument("--all", action="store_true", help="every axis")
    parser.add_argument("--walker", default="rabbit", metavar="NAME|FOLDER", help="default: rabbit")
    parser.add_argument("--gait", default="paper-polished", metavar="NAME|FILE.toml", help="default: paper-polished")
    text = "step that is pushed, or that lands behind the ledge (default: 1; ledge: 2)"
    parser.add_argument("--step", type=flags.whole(1), metavar="INT", help=text)
    parser.add_argument("--for", type=flags.real(above=0.0), dest="seconds", metavar="s", help="duration of a push")
    parser.add_argument("--steps", type=flags.whole(1), default=3, metavar="INT", help="of the walk (default: 3)")
    text = "of the ground (default: 0.8)"
    parser.add_argument("--friction", type=flags.real(above=0.0, most=10.0), default=0.8, metavar="RATIO", help=text)
    text = "longest step (default: 1.0)"
    parser.add_argument("--longest-step", type=flags.real(above=0.15, most=5.0), default=1.0, metavar="s", help=text)
    text = "largest angle of the torso (default: 1.0)"
    parser.add_argument("--torso", type=flags.real(above=0.0, most=1.5), default=1.0, metavar="rad", help=text)
    text = "mesh of a step, coarse to fine (default: 10 14 20)"
    parser.add_argument("--intervals", type=flags.whole(4), nargs="+", default=[10, 14, 20], metavar="INT", help=text)
    parser.add_argument("--starts", type=flags.whole(1), default=3, metavar="INT", help="guesses (default: 3)")
    text = "first that long under a controller that does not know; --controller says which"
    parser.add_argument("--blind", type=flags.real(above=0.0, most=1.0), default=0.0, metavar="s", help=text)
    parser.add_argument("--controller", metavar="KIND", help="of --blind (default: zd-pd)")
    parser.add_argument("--out", metavar="FILE.toml", help="file of limits; rows of other questions in it are kept")
    parser.add_argument("--log", metavar="RUN.mcap", help="walk nine tenths of a push into a log")
    text = "plant of that walk (default: rigid)"
    parser.add_argument("--plant", choices=("rigid", "mujoco"), default="rigid", help=text)
    add_json(parser, "the answers")
    add_quiet(parser)


def _run(found: Namespace) -> int:
    from sim.bridge import limits
    from sim.terminal.progress import progress_bar

    questions = _questions(found)
    limits.check_casadi()
    log, out = _files(found, questions)
    kept = _kept(out, limits.fingerprint(found.walker, found.gait), found.gait)
    answers: list[Any] = []
    with stop_on_signal() as stop:
        for question in questions:
            there = kept.row_of(question.key()) if found.all else None
            if there and question.searched_as(there):  # of an earlier call that was interrupted
                if not found.json:
                    print(f"{there['words']}: {there['value']:.4g} {there['unit']}\n  {there['sure']}", flush=True)
                continue
            with progress_bar(question.words(), quiet=found.quiet) as show:
                try:
                    answer = limits.ask(question, found.walker, found.gait, say=show, stop=stop)
                except UserError as error:
                    if not found.all:
                        raise
                    console.note(f"cmpc: {error}")
                    continue
                except limits.Interrupted as reason:
                    console.note(f"cmpc: {reason}{f'; {out} has what was found' if out and answers else ''}")
                    return 128 + stop.signum
            answers.append(answer)
            if not found.json:
                _tell(answer)  # first: no disk that is full can take it away
            if out:
                kept = kept.with_row(answer.record())
                kept.write(out)
    if found.json:
        rows = kept.rows if out and found.all else [answer.record() for answer in answers]
        print(json.dumps(list(rows)), flush=True)
    if log:
        question, walked = answers[0].question, answers[0].walked[0]
        summary = limits.walk(answers[0], found.walker, found.gait, log, found.plant)
        under = f"{question.value(walked.disturbance):.4g} {question.what.unit}"
        console.note(f"{log}: {summary.outcome} after {summary.steps} steps under {under}")
        console.next_step(f"cmpc review {log}")
    return 0


def _files(found: Namespace, questions: Sequence[Any]) -> tuple[Path | None, Path | None]:
    log = Path(found.log) if found.log else None
    if log:
        if len(questions) > 1 or questions[0].what.kind != "push" or questions[0].blind:
            raise UserError("--log: walks one push or impulse that is known from the start; must be of one such AXIS")
        check_new_log(log)
    out = Path(found.out) if found.out else None
    if out and not out.absolute().parent.is_dir():
        raise UserError(f"--out {out}: {out.absolute().parent} is no folder; must be in one")
    return log, out


def _kept(out: Path | None, walker: str, gait: str) -> Any:
    """The limits that a file has already."""
    from sim.trials.plan.limits import Limits, read_limits

    if out is None or not (out.is_file() or out.is_dir()):  # a device or a pipe is written into, and has nothing
        return Limits(walker=walker, gait=gait, rows=())
    kept = read_limits(out)
    if (kept.walker, kept.gait) != (walker, gait):
        raise UserError(f"--out {out}: has limits of gait {kept.gait!r}, walker {kept.walker}; must be another file")
    return kept


def _questions(found: Namespace) -> list[Any]:
    from sim.bridge.limits import AXES, Question, usual_step

    if found.all == (found.axis is not None):
        raise UserError(f"AXIS and --all: must be one of them; an AXIS is one of {', '.join(AXES)}")
    if found.all and (found.step is not None or found.seconds is not None or found.blind):
        raise UserError("--step, --for and --blind: are of one question; must be left out of --all")
    wanted = ALL if found.all else ((found.axis, found.step or usual_step(found.axis)),)
    intervals = tuple(sorted(set(found.intervals)))
    questions = [
        Question(
            axis=axis,
            step=step,
            seconds=found.seconds,
            steps=found.steps,
            friction=found.friction,
            longest=found.longest_step,
            torso=found.torso,
            intervals=intervals,
            starts=found.starts,
            blind=found.blind,
            controller=found.controller or ("zd-pd" if found.blind else ""),
        )
        for axis, step in wanted
    ]
    for question in questions:
        question.check()
    return questions


def _tell(answer: Any) -> None:
    question = answer.question
    value = f"{answer.value:.4g} {question.what.unit}"
    print(f"{question.words()}: {value}")
    print(f"  {answer.sure}")
    print(f"  steps of {', '.join(f'{t:.2f}' for t in answer.step_times)} s, friction {question.friction:g}")
    if answer.fit:
        print(f"  state after the blind time known to {answer.fit:.2g} rad, rad/s")
    if answer.replay:
        force = question.value(answer.walked[0].disturbance)
        gaps = ", ".join(f"{gap:.3f} rad after {t} s" for t, gap in answer.replay.items())
        print(f"  under {force:.4g} {question.what.unit}, least torque alone: off the rigid plant by {gaps}")
