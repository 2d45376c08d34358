"""How much is the simulator: a plan's trials again under other numerics, and which verdicts and figures change.

A variant changes one thing of how the plant is simulated and nothing of what is simulated, but for the rigid plant,
which is another idealisation of the same walker.
"""

import dataclasses
import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sim import pages
from sim.errors import UserError
from sim.scenario import with_values
from sim.trials.plan import MarginStudy, Plan
from sim.trials.plan.axis import label
from sim.trials.report.findings import edge_words, sides
from sim.trials.run import Results, TrialResult

AS_IT_IS = "as it is"
PAGE, DATA = "numerics.html", "numerics.json"

VARIANTS: Mapping[str, Mapping[str, Any]] = {
    AS_IT_IS: {},
    "step 0.5 ms": {"plant.timestep": 0.5e-3},
    "step 0.1 ms": {"plant.timestep": 0.1e-3},
    "step 0.05 ms": {"plant.timestep": 0.05e-3},
    "RK4": {"plant.integrator": "RK4"},
    "Euler": {"plant.integrator": "Euler"},
    "pyramidal cone": {"plant.contact.cone": "pyramidal"},
    "impratio 10": {"plant.contact.impratio": 10.0},
    "solref 4 ms": {"plant.contact.time_constant": 4e-3},
    "solimp from 0.9": {"plant.contact.impedance": 0.9},
    "solimp from 0.95": {"plant.contact.impedance": 0.95},
    "foot of 1 mm": {"plant.contact.foot_radius": 1e-3},
    "foot of 5 mm": {"plant.contact.foot_radius": 5e-3},
    "rigid": {"plant.kind": "rigid"},
    "rigid, scuffs are falls": {"plant.kind": "rigid", "plant.scuff": "trip"},
}
"""Name of a variant -> what it changes in a plan's scenario."""

FIGURES = ("output_error_rms_rad", "friction_ratio_max", "step_time_s", "rms_torque_all_Nm", "slip_m")
"""Fields of a trial's result that are compared between trials that survive."""

MOVED = 0.1  # relative, from which on a margin counts as another one

Run = Callable[[Plan, Path], Results]
"""Runs a plan into a folder."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Claim:
    """What a plan says, and what each variant makes of it.

    Attributes:
        name: Study, controller, and trial or side.
        said: What each variant says, by its name.
        differs: Variants that say something else than the plan as it is.
    """

    name: str
    said: Mapping[str, str]
    differs: tuple[str, ...]

    @property
    def verdict(self) -> str:
        """One line."""
        if not self.differs:
            return "does not depend on the simulator's numerics"
        return "does: " + "; ".join(f"{name}: {self.said[name]}" for name in self.differs)


@dataclass(frozen=True, slots=True, kw_only=True)
class Moved:
    """How far a figure of surviving trials moves.

    Attributes:
        figure: Field of `TrialResult`.
        controller: Whose.
        most: Largest relative change of the mean over trials that survive in both, by variant.
    """

    figure: str
    controller: str
    most: Mapping[str, float]


def variant(plan: Plan, name: str) -> Plan:
    """A plan under a variant, whatever it says of the same settings.

    Raises:
        UserError: what else the plan sets does not go with the variant.
    """
    return dataclasses.replace(plan, name=f"{plan.name}, {name}", scenario=with_values(plan.scenario, VARIANTS[name]))


def unfit(plan: Plan, name: str) -> str:
    """Why a variant would say nothing about a plan; empty where it does say something."""
    changed = VARIANTS[name]
    if not changed:
        return ""
    axes = [axis for study in plan.studies for axis in study.axes]
    own = {path for axis in axes for path in axis.paths}
    own |= {line.partition("=")[0].strip() for axis in axes for line in axis.also}
    if taken := own & changed.keys():
        return f"the plan's own studies set {min(taken)}"
    there = plan.scenario.plant
    try:
        if variant(plan, name).scenario.plant == there:
            return "the plan is that already"
    except UserError as error:
        return f"the plan's {error}"
    if there.kind == "rigid" and "plant.kind" not in changed and not changed.keys() & {"plant.timestep"}:
        return "the rigid plant has no contact, and one integrator"
    return ""


def run(plan: Plan, out: Path, variants: Sequence[str], run_one: Run) -> Path | None:
    """Run a plan under variants and write the page and its data.

    Args:
        plan: The plan.
        out: Folder; each variant's results go into one of their own.
        variants: Names in `VARIANTS`; the plan as it is comes first anyway, and those that are `unfit` are left out.
        run_one: Runs one variant's plan into its folder.

    Returns:
        Path of the page; None where the run was stopped early.

    Raises:
        UserError: the folder cannot be written, or a variant is not legal for this plan.
    """
    names = [name for name in dict.fromkeys((AS_IT_IS, *variants)) if not unfit(plan, name)]
    if names == [AS_IT_IS]:
        reasons = "; ".join(f"{name}: {unfit(plan, name)}" for name in variants if name != AS_IT_IS)
        raise UserError(f"plan {plan.name!r}: no variant says anything about it ({reasons or 'none was asked for'})")
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"--out {out}: cannot be written: {error.strerror}") from error
    found: dict[str, Results] = {}
    for name in names:
        folder = out / name.replace(" ", "-").replace(",", "")
        found[name] = run_one(variant(plan, name), folder)
        if found[name].interrupted:
            return None
    return write(plan, found, out)


def write(plan: Plan, found: Mapping[str, Results], out: Path) -> Path:
    """Write the page and its data; the page's path."""
    listed, moved = list(claims(found)), list(figures(found))
    held = sum(not claim.differs for claim in listed)
    others = [name for name in found if name != AS_IT_IS]
    left_out = {name: why for name in VARIANTS if (why := unfit(plan, name))}
    data = {
        "plan": plan.name,
        "variants": {name: dict(VARIANTS[name]) for name in found},
        "left_out": left_out,
        "claims": [dataclasses.asdict(claim) | {"verdict": claim.verdict} for claim in listed],
        "figures": [dataclasses.asdict(one) for one in moved],
    }
    page = pages.render(
        "numerics.html",
        title=f"{plan.name}: how much is the simulator",
        lead=f"{held} of {len(listed)} claims do not depend on the simulator's numerics, of {len(others)} variants.",
        claims=[(claim.name, claim.said[AS_IT_IS], claim.verdict) for claim in listed],
        figure_head=("figure", "controller", *others),
        figures=[(one.figure, one.controller, *(_percent(one.most.get(name)) for name in others)) for one in moved],
        variants=[
            *((name, ", ".join(f"{path} = {value}" for path, value in VARIANTS[name].items())) for name in others),
            *((name, f"left out: {why}") for name, why in left_out.items()),
        ],
    )
    pages.write(out / DATA, json.dumps(data, indent=1) + "\n")
    pages.write(out / PAGE, page)
    return out / PAGE


def _percent(change: float | None) -> str:
    return "-" if change is None else f"{100.0 * change:+.1f} %"


def claims(found: Mapping[str, Results]) -> Iterator[Claim]:
    """Every trial of grids and draws, and every side of margins, for each controller."""
    base = found[AS_IT_IS]
    for start, study in base.plan.offsets():
        if isinstance(study, MarginStudy):
            yield from _sides(found, study.name)
            continue
        for controller in base.plan.controllers:
            rows = {name: _rows(results, controller, start, start + study.size) for name, results in found.items()}
            for trial, row in rows[AS_IT_IS].items():
                values = ", ".join(f"{axis} = {value:g}" if isinstance(value, float) else f"{axis} = {value}"
                                   for axis, value in row.axis_values.items())  # fmt: skip
                said = {name: _fate(known.get(trial)) for name, known in rows.items()}
                fates = {name: known[trial].survived for name, known in rows.items() if trial in known}
                yield Claim(
                    name=f"{study.name}, {controller}: {values}",
                    said=said,
                    differs=tuple(name for name, survived in fates.items() if survived != row.survived),
                )


def _rows(results: Results, controller: str, first: int, last: int) -> dict[int, TrialResult]:
    return {row.trial: row for row in results.store.results(controller, first, last) if row.known}


def _fate(row: TrialResult | None) -> str:
    if row is None:
        return "no result"
    return f"walks {row.steps} steps" if row.survived else f"falls in step {row.steps + 1}"


def _sides(found: Mapping[str, Results], name: str) -> Iterator[Claim]:
    """Sides of a margin study; one differs where what is held moved by more than `MOVED` of it and the lattice."""
    every = {}
    for variant_name, results in found.items():
        study = next(study for study in results.plan.margin if study.name == name)
        every[variant_name] = {(label(side.axis), side.sign, side.controller): side for side in sides(results, study)}
    for key, side in every[AS_IT_IS].items():
        there = {variant_name: known[key] for variant_name, known in every.items() if key in known}
        room = max(MOVED * side.share, 1.5 / max(1, abs(side.axis.ends[side.sign > 0])))
        yield Claim(
            name=f"{name}, {key[2]}: {key[0]}, {'up' if key[1] > 0 else 'down'}",
            said={variant_name: edge_words(other) for variant_name, other in there.items()},
            differs=tuple(n for n, other in there.items() if abs(other.share - side.share) > room),
        )


def figures(found: Mapping[str, Results]) -> Iterator[Moved]:
    """How far figures move, over the trials that survive both ways."""
    base = found[AS_IT_IS]
    for controller in base.plan.controllers:
        rows = {name: _rows(results, controller, 0, 2**62) for name, results in found.items()}
        for figure in FIGURES:
            yield Moved(
                figure=figure,
                controller=controller,
                most={
                    name: change
                    for name, known in rows.items()
                    if name != AS_IT_IS and (change := _change(rows[AS_IT_IS], known, figure)) is not None
                },
            )


def _change(base: Mapping[int, TrialResult], other: Mapping[int, TrialResult], figure: str) -> float | None:
    """Relative change of the mean of a figure; None where there is nothing to compare."""
    both = [trial for trial in base if trial in other and base[trial].survived and other[trial].survived]
    pairs = [(getattr(base[trial], figure), getattr(other[trial], figure)) for trial in both]
    known = [(a, b) for a, b in pairs if a is not None and b is not None]
    before, after = (math.fsum(pair[i] for pair in known) for i in (0, 1))
    return after / before - 1.0 if known and before else None
