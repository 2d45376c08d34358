"""Layouts for viewers people have: Foxglove or Lichtblick (JSON), PlotJuggler (XML), from one table of plots."""

import json
from collections.abc import Mapping
from typing import Any, NamedTuple
from xml.etree import ElementTree

from sim.interface import JOINTS
from sim.log.format.fields import OUTPUTS
from sim.pages.palette import COLOURS


class LayoutPlot(NamedTuple):
    """One plot of a viewer.

    Attributes:
        title: Heading with the unit.
        curves: Message path ("/control.u_zd.left_hip") -> label.
        x: Message path of the horizontal axis, empty for time.
    """

    title: str
    curves: Mapping[str, str]
    x: str = ""


def _words(name: str) -> str:
    return name.replace("_", " ")


def _per_output(group: str) -> dict[str, str]:
    return {f"/control.{group}.{name}": _words(name) for name in OUTPUTS}


TABS: Mapping[str, tuple[LayoutPlot, ...]] = {
    "Torques": tuple(
        LayoutPlot(
            f"{_words(joint)} [N.m]",
            {
                f"/control.u_zd.{joint}": "ZD+PD",
                f"/control.u_mpc.{joint}": "MPC",
                f"/plant/state.torque.{joint}": "applied",
            },
        )
        for joint in JOINTS
    ),
    "Tracking": (
        LayoutPlot("outputs y [rad]", _per_output("y")),
        LayoutPlot("output rates dy [rad/s]", _per_output("dy")),
        LayoutPlot("phase portrait of theta [rad/s over rad]", {"/control.dtheta": "dtheta"}, x="/control.theta"),
        LayoutPlot("hip speed [m/s]", {"/plant/state.dhip.x": "forward", "/plant/state.dhip.z": "up"}),
    ),
    "Contact": (
        LayoutPlot(
            "normal force [N]",
            {
                "/plant/state.contact_force.left.normal": "left",
                "/plant/state.contact_force.right.normal": "right",
                "/control.contact_force.normal": "expected",
            },
        ),
        LayoutPlot(
            "tangential force [N]",
            {
                "/plant/state.contact_force.left.tangential": "left",
                "/plant/state.contact_force.right.tangential": "right",
                "/control.contact_force.tangential": "expected",
            },
        ),
        LayoutPlot(
            "prediction error of the contact force [N]",
            {
                "/prediction/error.contact_force.normal": "normal",
                "/prediction/error.contact_force.tangential": "tangential",
            },
        ),
        LayoutPlot("ticks to the next predicted impact [tick]", {"/control.impact_in": "impact in"}),
    ),
    "Solver": (
        LayoutPlot("computing time [s]", {"/timing.tick": "whole tick", "/timing.solve": "solver"}),
        LayoutPlot("active constraints [1]", {"/mpc.active": "active", "/mpc.iterations": "iterations"}),
        LayoutPlot("softening of the contact rows [N]", {"/mpc.slack": "largest"}),
        LayoutPlot(
            "residuals [N.m]",
            {f"/mpc.residual.{name}": name for name in ("primal", "dual", "gap")},
        ),
    ),
}
"""Tab -> its four plots."""


def foxglove() -> str:
    """Layout for Foxglove and Lichtblick (import from file): the walker in 3D, tabs of plots, the events."""
    panels: dict[str, Any] = {
        "3D!walk": {
            "cameraState": {
                "perspective": True,
                "distance": 3.0,
                "phi": 84,
                "thetaOffset": 0,
                "targetOffset": [0, 0, -0.1],
                "target": [0, 0, 0],
                "targetOrientation": [0, 0, 0, 1],
                "fovy": 45,
                "near": 0.1,
                "far": 500,
            },
            "followMode": "follow-position",
            "followTf": "torso",
            "scene": {"transforms": {"visible": False, "showLabel": False, "axisScale": 0}},
            "transforms": {},
            "topics": {"/scene": {"visible": True}, "/forces": {"visible": True}},
            "layers": {},
        },
        "RosOut!events": {"searchTerms": [], "minLogLevel": 1, "topicToRender": "/events"},
        "StateTransitions!legs": {
            "isSynced": True,
            "paths": [
                {"value": path, "label": label, "timestampMethod": "receiveTime"}
                for path, label in (("/control.stance", "stance"), ("/mpc.status", "solver"))
            ],
        },
    }
    tabs = []
    for tab, plots in TABS.items():
        names = [f"Plot!{tab.lower()}{number}" for number in range(len(plots))]
        panels.update(zip(names, map(_foxglove_plot, plots), strict=True))
        tabs.append({"title": tab, "layout": _four(*names)})
    panels["Tab!plots"] = {"activeTabIdx": 0, "tabs": tabs}
    left = _split("column", "3D!walk", _split("column", "StateTransitions!legs", "RosOut!events", 40), 55)
    layout = {
        "configById": panels,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": _split("row", left, "Tab!plots", 38),
    }
    return json.dumps(layout, indent=1) + "\n"


def _split(direction: str, first: Any, second: Any, percent: int = 50) -> dict[str, Any]:
    return {"direction": direction, "first": first, "second": second, "splitPercentage": percent}


def _four(a: str, b: str, c: str, d: str) -> dict[str, Any]:
    return _split("row", _split("column", a, b), _split("column", c, d))


def _foxglove_plot(plot: LayoutPlot) -> dict[str, Any]:
    paths = [
        {"value": path, "label": label, "enabled": True, "color": colour, "timestampMethod": "receiveTime"}
        for (path, label), colour in zip(plot.curves.items(), COLOURS, strict=False)
    ]
    axis: dict[str, Any] = {"xAxisVal": "timestamp"}
    if plot.x:
        axis = {"xAxisVal": "custom", "xAxisPath": {"value": plot.x, "enabled": True, "timestampMethod": "receiveTime"}}
    return {
        "title": plot.title,
        "foxglovePanelTitle": plot.title,
        "lichtblickPanelTitle": plot.title,  # the key that Lichtblick's panels read
        "paths": paths,
        "showLegend": True,
        "legendDisplay": "floating",
        "showPlotValuesInLegend": True,
        "showXAxisLabels": True,
        "showYAxisLabels": True,
        "isSynced": True,
        "sidebarDimension": 240,
        **axis,
    }


def plotjuggler() -> str:
    """Layout for PlotJuggler: plotjuggler -d RUN.mcap -l LAYOUT.xml."""
    root = ElementTree.Element("root")
    widget = ElementTree.SubElement(root, "tabbed_widget", {"name": "Main Window", "parent": "main_window"})
    for tab, plots in TABS.items():
        page = ElementTree.SubElement(widget, "Tab", tab_name=tab, containers="1")
        container = ElementTree.SubElement(page, "Container")
        split = ElementTree.SubElement(container, "DockSplitter", orientation="|", count="2", sizes="0.5;0.5")
        for pair in (plots[:2], plots[2:]):
            column = ElementTree.SubElement(split, "DockSplitter", orientation="-", count="2", sizes="0.5;0.5")
            for plot in pair:
                _plotjuggler_plot(column, plot)
    ElementTree.SubElement(widget, "currentTabIndex", index="0")
    ElementTree.SubElement(root, "use_relative_time_offset", enabled="1")
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode", xml_declaration=True) + "\n"


def _plotjuggler_plot(column: ElementTree.Element, plot: LayoutPlot) -> None:
    area = ElementTree.SubElement(column, "DockArea", name=plot.title)
    kind = "XYPlot" if plot.x else "TimeSeries"
    box = ElementTree.SubElement(area, "plot", style="Lines", mode=kind, flip_x="false", flip_y="false")
    ElementTree.SubElement(box, "limitY")
    for (path, label), colour in zip(plot.curves.items(), COLOURS, strict=False):
        name, x = series_name(path), series_name(plot.x)
        if plot.x:
            ElementTree.SubElement(box, "curve", name=label, color=colour, curve_x=x, curve_y=name)
        else:
            ElementTree.SubElement(box, "curve", name=name, color=colour)


def series_name(path: str) -> str:
    """PlotJuggler's name of a message path: "/control.u_zd.left_hip" is "/control/u_zd/left_hip"."""
    return path.replace(".", "/")


LAYOUTS = {"foxglove": foxglove, "lichtblick": foxglove, "plotjuggler": plotjuggler}
"""Viewer -> text of its layout."""
