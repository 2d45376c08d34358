"""The plots of the review page: which signals stand together, in which unit, against which limit."""

from collections.abc import Mapping
from dataclasses import dataclass

from sim.interface import JOINTS, LEGS
from sim.log.format.fields import OUTPUTS


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """One line of a plot.

    Attributes:
        key: Signal, see `sim.review.signals`.
        label: Its name in the legend.
        colour: A colour of the page's style sheet.
        horizon: Series of /prediction that is drawn ahead of the cursor, empty for none.
    """

    key: str
    label: str
    colour: str
    horizon: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Panel:
    """One plot.

    Attributes:
        name: Short name, for tests and links.
        title: Heading.
        unit: Unit of the vertical axis.
        lines: What is drawn.
        x: Signal of the horizontal axis, empty for time.
        x_unit: Its unit.
        limits: Key of the limits drawn in it (torque limits by joint, "friction"), empty for none.
        clip: Whether rare peaks may leave the plot at first.
        log: Whether the vertical axis is logarithmic.
        note: One sentence for the curious.
    """

    name: str
    title: str
    unit: str
    lines: tuple[Line, ...]
    x: str = ""
    x_unit: str = "s"
    limits: str = ""
    clip: bool = False
    log: bool = False
    note: str = ""


_LEG_COLOUR = {"left": "left", "right": "right"}
_OUTPUT_COLOUR = dict(zip(OUTPUTS, ("c1", "c2", "c3", "c4"), strict=True))


def _words(name: str) -> str:
    return name.replace("_", " ")


PANELS = (
    *(
        Panel(
            name=f"torque-{joint}",
            title=f"Torque, {_words(joint)}",
            unit="N·m",
            limits=joint,
            clip=True,
            note="Commanded torque is ZD+PD + MPC; the motor applies it within its limits.",
            lines=(
                Line(key=f"u_zd.{joint}", label="ZD+PD", colour="zd"),
                Line(key=f"u_mpc.{joint}", label="MPC", colour="mpc"),
                Line(key=f"torque.{joint}", label="applied", colour="ink"),
            ),
        )
        for joint in JOINTS
    ),
    Panel(
        name="outputs",
        title="Outputs y",
        unit="rad",
        clip=True,
        note="Error of each controlled angle against the gait; dotted: what the MPC expects over its horizon.",
        lines=tuple(Line(key=f"y.{o}", label=_words(o), colour=_OUTPUT_COLOUR[o], horizon=o) for o in OUTPUTS),
    ),
    Panel(
        name="output-rates",
        title="Output rates dy",
        unit="rad/s",
        clip=True,
        lines=tuple(Line(key=f"dy.{o}", label=_words(o), colour=_OUTPUT_COLOUR[o]) for o in OUTPUTS),
    ),
    Panel(
        name="phase",
        title="Phase portrait of θ",
        unit="rad/s",
        x="theta",
        x_unit="rad",
        note="Clock rate over clock, and the orbit that the gait has where its outputs are zero.",
        lines=(
            Line(key="dtheta.nominal", label="nominal orbit", colour="zd"),
            Line(key="dtheta", label="dθ/dt", colour="c1"),
        ),
    ),
    Panel(
        name="energy",
        title="Energy about the stance foot",
        unit="J",
        clip=True,
        note="Kinetic and potential energy above the stance foot; grey: the gait's own at the same clock.",
        lines=(
            Line(key="energy.nominal", label="nominal", colour="zd"),
            Line(key="energy", label="real", colour="c1"),
        ),
    ),
    Panel(
        name="momentum",
        title="Angular momentum about the stance foot",
        unit="N·m·s",
        clip=True,
        note="What the zero dynamics live on, positive forwards; grey: the gait's own at the same clock.",
        lines=(
            Line(key="momentum.nominal", label="nominal", colour="zd"),
            Line(key="momentum", label="real", colour="c2"),
        ),
    ),
    Panel(
        name="friction",
        title="Friction ratio of the stance foot",
        unit="",
        limits="friction",
        clip=True,
        note="|F_T / F_N| of the foot the controller stands on.",
        lines=(
            Line(key="ratio.expected", label="expected", colour="mpc"),
            Line(key="ratio", label="real", colour="ink"),
        ),
    ),
    *(
        Panel(
            name=part,
            title=f"Contact force, {part}",
            unit="N",
            clip=True,
            lines=(
                Line(key=f"expected.{part}", label="expected", colour="mpc", horizon=part),
                *(Line(key=f"force.{leg}.{part}", label=leg, colour=_LEG_COLOUR[leg]) for leg in LEGS),
            ),
        )
        for part in ("normal", "tangential")
    ),
    Panel(
        name="force-error",
        title="Prediction error: contact force",
        unit="N",
        clip=True,
        note="What MuJoCo gave over the hold minus what the controller had expected of it.",
        lines=(
            Line(key="error.normal", label="normal", colour="c1"),
            Line(key="error.tangential", label="tangential", colour="c2"),
        ),
    ),
    Panel(
        name="impact-error",
        title="Prediction error: next impact",
        unit="ms",
        clip=True,
        note="Predicted time of the next touch-down minus the real one; above 0 it came early.",
        lines=(Line(key="impact_error", label="predicted − real", colour="c3"),),
    ),
    Panel(
        name="timing",
        title="Computing time",
        unit="ms",
        log=True,
        clip=True,
        lines=(
            Line(key="tick", label="whole tick", colour="zd"),
            Line(key="solve", label="solver", colour="mpc"),
        ),
    ),
    Panel(
        name="constraints",
        title="Active constraints over the horizon",
        unit="",
        lines=(
            Line(key="active", label="active", colour="c1"),
            Line(key="iterations", label="iterations", colour="c4"),
        ),
    ),
    Panel(
        name="slack",
        title="Softening of the contact rows",
        unit="N",
        note="Where torque limits and friction conflict, the friction rows give way by this much.",
        lines=(Line(key="slack", label="largest", colour="mpc"),),
    ),
    Panel(
        name="speed",
        title="Hip speed",
        unit="m/s",
        lines=(Line(key="speed", label="forward", colour="c1"),),
    ),
    Panel(
        name="torso",
        title="Torso angle",
        unit="rad",
        lines=(Line(key="q.torso", label="torso", colour="ink"),),
    ),
    Panel(
        name="clearance",
        title="Foot clearance",
        unit="mm",
        lines=tuple(Line(key=f"clearance.{leg}", label=leg, colour=_LEG_COLOUR[leg]) for leg in LEGS),
    ),
    Panel(
        name="push",
        title="External force",
        unit="N",
        lines=(
            Line(key="push.x", label="forward", colour="mpc"),
            Line(key="push.z", label="up", colour="zd"),
            Line(key="diagnostics.observed_push", label="observed", colour="ink"),
        ),
    ),
)
"""In the order of the page."""

_COLOURS = ("c1", "c2", "c3", "c4", "zd", "mpc", "left", "right")


def diagnostics_panels(units: Mapping[str, str]) -> tuple[Panel, ...]:
    """Plots of a law's own figures: those of one unit together, as many as there are colours.

    Args:
        units: Unit by the figure's name, "1" for a pure number.
    """
    found = []
    for unit in dict.fromkeys(units.values()):
        names = [name for name, its in units.items() if its == unit]
        for first in range(0, len(names), len(_COLOURS)):
            some = names[first : first + len(_COLOURS)]
            lines = tuple(
                Line(key=f"diagnostics.{name}", label=_words(name), colour=colour)
                for name, colour in zip(some, _COLOURS, strict=False)
            )
            title = f"Controller's own: {', '.join(map(_words, some))}"
            found.append(
                Panel(name=f"own-{some[0]}", title=title, unit="" if unit == "1" else unit, lines=lines, clip=True)
            )
    return tuple(found)
