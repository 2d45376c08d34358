"""A log that shows itself in a notebook: the answer, a stroboscopic picture, figures, three plots."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sim.errors import UserError
from sim.interface import JOINTS, LEGS
from sim.log.format.fields import OUTPUTS
from sim.log.read.frames import Run, load
from sim.pages.palette import BLUE, ORANGE
from sim.pages.picture import picture
from sim.review import facts
from sim.review.answer import answer
from sim.review.signals import Signals, decimated, signals_of

SPAN = 2.4  # [s] that the stroboscopic picture shows
POSES = 17
SAMPLES = 800  # of a line
INKS = {"left": BLUE, "right": ORANGE}
WIDTH, HEIGHT = 560.0, 120.0  # [pixel]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Log(Run):
    """A log as frames that a notebook shows as a card; `/topic` -> columns by dotted field name."""

    @property
    def answer(self) -> str:
        """How the run ended, why and when, in one sentence."""
        return answer(self)[0]

    @property
    def onset(self) -> float | None:
        """The moment in [s] at which a fall began, None without one."""
        return answer(self)[1]

    def _repr_html_(self) -> str:
        """The card."""
        return card(self)


def read(path: Path | str) -> Log:
    """A log as frames.

    Args:
        path: The MCAP file.

    Raises:
        UserError: it cannot be read or is damaged.
    """
    run = load(path)
    return Log(log=run.log, frames=run.frames, events=run.events)


def card(run: Run) -> str:
    """A run as a piece of HTML that needs no script and fetches nothing."""
    from markupsafe import Markup

    try:
        signals = signals_of(run)
    except UserError as error:
        return str(Markup("<p>{}</p>").format(error))
    words, moment = answer(run, signals)
    rows = Markup().join(
        Markup("<tr><th style='text-align:left'>{}</th><td style='text-align:left'>{}</td></tr>").format(*row)
        for row in facts.summary(run)
        if row[1] != "–"
    )
    head = facts.headline(run)
    return str(
        Markup(
            "<div><p><b>{}</b>: {}</p>{}<details open><summary>figures</summary><table>{}</table></details>{}</div>"
        ).format(head["name"], words, strobe(run, signals, moment), rows, Markup().join(_plots(run, signals)))
    )


def strobe(run: Run, signals: Signals, moment: float | None) -> Any:
    """The walker at equal times, the last ones of a fall, the first ones of a walk."""
    end = float(signals.t[-1])
    first = max(0.0, (end if moment is not None else min(SPAN, end)) - SPAN)
    times = np.linspace(first, min(first + SPAN, end), POSES)
    at = np.searchsorted(signals.t, times).clip(max=len(signals.t) - 1)
    lengths, columns = facts.geometry(run), signals.columns

    def on(base: Any, length: float, angle: Any) -> tuple[Any, Any]:
        return base[0] - length * np.sin(angle), base[1] + length * np.cos(angle)

    q = {name: columns[f"q.{name}"][at] for name in ("torso", *JOINTS)}
    hip = columns["hip.x"][at], columns["hip.z"][at]
    with picture("the walker at equal times", WIDTH, 150.0, bare=True) as made:
        axes = made.axes
        x = [line[0] for line in lengths["ground"]], [line[1] for line in lengths["ground"]]
        axes.plot(*x, color="0.6", linewidth=1, clip_on=True)
        for i in range(len(at)):
            shade = 0.25 + 0.75 * i / len(at)
            for leg in LEGS:
                upper = q["torso"] + q[f"{leg}_hip"]
                knee = on(hip, lengths[f"{leg}_femur"], upper)
                foot = on(knee, lengths[f"{leg}_tibia"], upper + q[f"{leg}_knee"])
                line = [(part[0][i], part[1][i]) for part in (hip, knee, foot)]
                axes.plot(*zip(*line, strict=True), color=INKS[leg], alpha=shade, linewidth=1.6)
            head = on(hip, lengths["torso"], q["torso"])
            axes.plot([hip[0][i], head[0][i]], [hip[1][i], head[1][i]], color="0.45", alpha=shade, linewidth=2.4)
        axes.set_xlim(float(np.nanmin(hip[0])) - 0.8, float(np.nanmax(hip[0])) + 0.8)
        axes.set_aspect("equal")
        axes.set_yticks([])
    return made.svg


def _plots(run: Run, signals: Signals) -> list[Any]:
    t, columns = decimated(signals, SAMPLES)
    limits = facts.limit_of_torque(run)
    found = []
    for title, keys, names in (
        ("joint torque [N.m]", [f"torque.{joint}" for joint in JOINTS], JOINTS),
        ("output error [rad]", [f"y.{output}" for output in OUTPUTS], OUTPUTS),
        ("|F_T / F_N| of the stance foot", ["ratio"], ("",)),
    ):
        with picture(title, WIDTH, HEIGHT) as made:
            for key, name in zip(keys, names, strict=True):
                made.axes.plot(t, columns[key], linewidth=1, label=name.replace("_", " "))
            if title.startswith("joint"):
                for limit in sorted({*limits.values()}):
                    made.axes.axhline(limit, color="0.6", linewidth=0.8, linestyle=":")
                    made.axes.axhline(-limit, color="0.6", linewidth=0.8, linestyle=":")
            if len(keys) > 1:
                made.axes.legend(fontsize=7, ncols=4, loc="upper right")
            made.axes.set_title(title, loc="left")
            made.axes.set_xlabel("t [s]")
            calm = signals.t < signals.t[-1] - 0.3  # a fall's last moments would be all there is to see
            values = np.concatenate([signals.columns[key][calm] for key in keys]) if calm.any() else np.zeros(0)
            values = values[np.isfinite(values)]
            if values.size and run.result.get("outcome") == "fell":
                low, high = float(values.min()), float(values.max())
                made.axes.set_ylim(low - 0.1 * (high - low), high + 0.1 * (high - low) + 1e-9)
        found.append(made.svg)
    return found
