"""The colours of every page and picture; `style.css` has those that change between light and dark."""

COLOURS = ("#1f6fb2", "#d9722a", "#2f9e6e", "#8a5fbf", "#b8962e", "#c2608f")
"""Of controllers, in the plan's order."""

BLACK, GREY, BLUE, ORANGE, RED = "#1a1a1a", "#8c8c8c", "#1f6fb2", "#d9722a", "#c8442f"
FELL, SURVIVED = RED, "#3d9a63"
LIGHT = "#8a929b2e"
"""Tracks: see-through, so that they suit light and dark paper."""

CAUSES = {
    "start": "#9aa1a9",
    "actuator": "#a8327d",
    "delay": "#4f7f3f",
    "sensor": "#7fb069",
    "clearance": "#8d6e4a",
    "friction": "#3f9aa8",
    "contact": "#5b78c7",
    "energy": "#d8a31f",
    "prediction": "#8a5fbf",
    "landing": "#b39ddb",
    "torque": "#c8442f",
    "solver": "#e07b39",
    "tracking": "#f0a6a0",
    "unclear": "#c9ced4",
}
"""Of the first words of `sim.trials.falls.cause.Cause`."""


def colour(place: int) -> str:
    """Colour of the controller at a place in the plan."""
    return COLOURS[place % len(COLOURS)]
