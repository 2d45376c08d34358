"""What the review page says in words: headline, summary table, scenario, versions."""

import math
from collections.abc import Mapping
from typing import Any

from controller.common import toml
from sim.log.read.frames import Run, parsed
from sim.log.tools.text import printable
from sim.loop import Outcome
from sim.pages import number
from sim.scenario import Scenario, from_toml, load, settings_table, shipped

MOST_EVENTS = 500
MOST_CHANGES = 4  # in the headline
WORDS = ("name", "description")
UNKNOWN = ("plant.", "sensors.", "actuation.")
"""Settings of what a controller is not told."""
KNOWN = ("plant.kind", "plant.scuff", "plant.timestep", "plant.integrator", "plant.ground.friction")
"""Among them: how the truth is computed, and what is compared with the controller's own."""
MOST_POINTS = 20_000  # of the ground
LONGEST_TEXT = 20_000  # characters of the scenario that are shown


def scenario_of(run: Run) -> Scenario | None:
    """The scenario of a log, None where it is missing or of another version of the program."""
    try:
        return from_toml(run.scenario_toml, trusted=False) if run.scenario_toml else None
    except ValueError:  # a UserError is one
        return None


def headline(run: Run) -> dict[str, str]:
    """Name, controller, outcome and detail of a run."""
    scenario, result = scenario_of(run), run.result
    damage = [f"damaged at byte {at}: {text}" for at, text in run.log.problems[:3]]
    if not run.log.complete and not damage:
        damage = ["the log was not finished: the run was killed, or the file is cut off"]
    if "recovery" in run.log.metadata:
        damage.append("recovered; lost: " + run.log.metadata["recovery"].get("lost", ""))
    name = scenario.name if scenario else run.about.get("scenario", run.log.path.stem)
    return {
        "name": printable(name),
        "description": printable(description(scenario)) if scenario else "",
        "controller": printable(scenario.controller.kind if scenario else ""),
        "outcome": printable(result.get("outcome", "not finished")),
        "detail": printable(result.get("fall_reason") or result.get("message") or ""),
        "file": printable(run.log.path.name),
        "damage": printable("; ".join(damage)),
    }


def changed_settings(scenario: Scenario) -> list[tuple[str, str, str]]:
    """Settings that differ from the shipped scenario of the same name: path, value there, value here."""
    if scenario.name not in shipped():
        return []
    here, there = ({row.path: row for row in settings_table(one)} for one in (scenario, load(scenario.name)))
    paths = [path for path in {**there, **here} if path not in WORDS]

    told = [path for path in paths if path in there or here[path].value != here[path].spec.default]
    pairs = ((path, _setting(there.get(path)), _setting(here.get(path))) for path in told)
    return [(path, a, b) for path, a, b in pairs if a != b]


def changed(run: Run) -> list[tuple[str, str, str]]:
    """The same of a log; nothing where its scenario cannot be read."""
    scenario = scenario_of(run)
    return changed_settings(scenario) if scenario else []


def disagreements(run: Run) -> list[tuple[str, str, str]]:
    """What the controller does not know of the plant: what, what is so, what it believes."""
    scenario = scenario_of(run)
    if scenario is None:
        return []
    found = [
        (row.path, _setting(row), _value(row.spec.default, row.spec.unit) if row.spec.default is not None else "-")
        for row in settings_table(scenario)
        if row.path.startswith(UNKNOWN) and row.path not in KNOWN and row.value not in (None, row.spec.default)
    ]
    ground, believed = scenario.plant.ground, scenario.controller.friction
    if ground.friction != believed:
        found.append(("friction", number(ground.friction), number(believed)))
    return found


def _setting(row: Any) -> str:
    """A row of the settings' table as text with its unit, "-" where it is missing."""
    return "-" if row is None or row.value is None else _value(row.value, row.spec.unit)


def _value(value: Any, unit: str | None) -> str:
    return f"{number(value)} {unit or ''}".rstrip()


def description(scenario: Scenario) -> str:
    """What was run: the description of a named scenario as it is, else what was changed in it."""
    changed = changed_settings(scenario)
    if not changed:
        return scenario.description
    words = [f"{path} = {here} (not {there})" for path, there, here in changed[:MOST_CHANGES]]
    more = f" and {len(changed) - MOST_CHANGES} more" if len(changed) > MOST_CHANGES else ""
    return f"{scenario.name} with {', '.join(words)}{more}"


def summary(run: Run) -> list[tuple[str, str]]:
    """Figures of the run, name and text."""
    r = run.result
    fall = ", the fall with it" * (r.get("outcome") == Outcome.FELL.value)
    rows = [
        ("steps", _text(r.get("steps"), "{:.0f}")),
        ("simulated time", _text(r.get("time_s"), "{:.3f} s")),
        ("step time", _text(r.get("step_time_s"), "{:.3f} s")),
        ("step length", _text(r.get("step_length_m"), "{:.3f} m")),
        ("mean speed", _text(_over(r.get("step_length_m"), r.get("step_time_s")), "{:.3f} m/s")),
    ]
    limits = limit_of_torque(run)
    peaks = r.get("peak_torque_Nm")
    for joint, peak in peaks.items() if isinstance(peaks, dict) else ():
        limit = f" of {limits[joint]:g}" if joint in limits else ""
        rows.append((f"peak torque, {joint.replace('_', ' ')}", _text(peak, "{:.1f}") + limit + " N·m"))
    rows += [
        ("worst |F_T / F_N|", _text(r.get("friction_ratio_max"), "{:.3f}")),
        ("output error, RMS", _text(r.get("output_error_rms_rad"), "{:.4f} rad" + fall)),
        ("MPC torque / ZD+PD torque", _text(r.get("mpc_torque_share"), "{:.3f}")),
        ("solve time", _times(r.get("solve_ms"))),
        ("tick time", _times(r.get("tick_ms"))),
        ("swing foot below ground", _scuff(r)),
        ("fall-backs to ZD+PD", _text(r.get("fallbacks"), "{:.0f} ticks")),
        ("softening of contact rows", _text(r.get("slack_max_N"), "{:.3g} N")),
        ("speed", _text(r.get("realtime_factor"), "{:.2f} × real time")),
    ]
    return [(printable(name), text) for name, text in rows]


def _scuff(result: Mapping[str, Any]) -> str:
    """Depth and time of the swing foot below the ground."""
    depth, time = result.get("scuff_depth_m"), result.get("scuff_time_s")
    if not isinstance(depth, float) or not isinstance(time, float):
        return _text(None, "")
    return f"{1e3 * depth:.2f} mm at most, {1e3 * time:.0f} ms in all" if time > 0.0 else "never"


def provenance(run: Run) -> list[tuple[str, str]]:
    """Where the run came from."""
    about = run.about
    versions = parsed(about.get("versions", "{}"))
    words = ", ".join(f"{k} {v}" for k, v in versions.items()) if isinstance(versions, dict) else ""
    dirty = " with changes" if about.get("git_dirty") == "true" else ""
    rows = [
        ("file", run.log.path.name),
        ("seed", about.get("seed", "")),
        ("started", about.get("started", "")),
        ("revision", about.get("git_revision", "")[:12] + dirty),
        ("versions", words),
        ("platform", about.get("platform", "")),
    ]
    return [(name, printable(text, 600)) for name, text in rows if text]


def scenario_text(run: Run) -> str:
    """The scenario as TOML, cut where it is too long."""
    return run.scenario_toml[:LONGEST_TEXT]


def events(run: Run) -> list[dict[str, Any]]:
    """The first events, for marks and table."""
    return [
        {"t": e.t, "level": e.level, "name": printable(e.name, 40), "message": printable(e.message)}
        for e in run.events[:MOST_EVENTS]
    ]


def limit_of_torque(run: Run) -> dict[str, float]:
    """Torque limit of each joint in [N.m]; joints without one are missing."""
    found = run.result.get("torque_limit_Nm")
    pairs = found.items() if isinstance(found, dict) else ()
    return {str(name): float(v) for name, v in pairs if isinstance(v, int | float) and math.isfinite(v)}


def limits(run: Run) -> dict[str, list[dict[str, Any]]]:
    """Limit lines by the name that a panel asks for."""
    found: dict[str, list[dict[str, Any]]] = {
        joint: [{"value": v, "label": "limit"}, {"value": -v, "label": ""}] for joint, v in limit_of_torque(run).items()
    }
    scenario = scenario_of(run)
    if scenario:
        believed, real = scenario.controller.friction, scenario.plant.ground.friction
        found["friction"] = [{"value": real, "label": "μ" if believed == real else "μ of the ground"}]
        if believed != real:
            found["friction"].append({"value": believed, "label": "μ assumed"})
    return found


def geometry(run: Run) -> dict[str, Any]:
    """Lengths of the links in [m] and the line of the ground, for the figure."""
    lengths = parsed(run.about.get("link_lengths", "{}"))
    lengths = lengths if isinstance(lengths, dict) else {}
    limbs = ("left_femur", "left_tibia", "right_femur", "right_tibia")
    return {
        "torso": _length(lengths.get("torso"), 0.63),
        **{limb: _length(lengths.get(limb), 0.4) for limb in limbs},
        "ground": _ground(parsed(run.about.get("ground", "[]"))),
    }


def _ground(points: Any) -> list[tuple[float, float]]:
    """Line of the ground as (x, z) in [m], level where the log has none."""
    found = []
    for point in points[:MOST_POINTS] if isinstance(points, list) else ():
        pair: tuple[Any, Any] = tuple(point) if isinstance(point, list) and len(point) == 2 else ("", "")
        if all(isinstance(v, int | float) and abs(v) < 1e6 for v in pair):
            found.append((float(pair[0]), float(pair[1])))
    return sorted(found, key=lambda p: p[0]) if len(found) > 1 else [(-10.0, 0.0), (1000.0, 0.0)]


def controller_of(run: Run) -> str:
    """Kind of the controller, "" if unknown; read even from a scenario of another version."""
    try:
        kind = toml.loads(run.scenario_toml).get("controller", {}).get("kind", "")
    except (ValueError, AttributeError):
        kind = ""
    return printable(kind)


def _length(value: Any, default: float) -> float:
    return float(value) if isinstance(value, int | float) and 0.01 < value < 10.0 else default


def _text(value: Any, pattern: str) -> str:
    known = isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
    return pattern.format(float(value)) if known else "–"


def _over(a: Any, b: Any) -> float | None:
    return a / b if isinstance(a, int | float) and isinstance(b, int | float) and b else None


def _times(value: Any) -> str:
    if not isinstance(value, dict) or not value.get("max"):
        return "–"  # a law without a solver spends no time in one
    return ", ".join(f"{printable(k, 20)} {_text(v, '{:.3f}')}" for k, v in value.items()) + " ms"
