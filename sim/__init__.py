"""Walking robots under model predictive control, on a plant with contact: what a user needs, by name.

Everything here is loaded when it is first asked for; `import sim` alone loads no engine. What is not listed here is
private and may change.

    import sim

    scenario = sim.with_value(sim.load("push-25N"), "plant.mass_factor.torso", 1.2)
    summary = sim.run(scenario, controller="./mine.py:make", log="run.mcap")
    sim.write_review("run.mcap", "run.html")

See docs/api.md.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    __version__: str
    from controller.common.errors import UserError
    from controller.common.records import Controller, ControlStep, Observation
    from sim.api import design, limit, read, replay, run, run_trials, write_review
    from sim.loop import RunSummary as Summary
    from sim.review.shown import Log
    from sim.scenario import Scenario, load, with_value, with_values

_HOMES = {
    "Controller": ("controller.common.records", "Controller"),
    "ControlStep": ("controller.common.records", "ControlStep"),
    "Log": ("sim.review.shown", "Log"),
    "Observation": ("controller.common.records", "Observation"),
    "Scenario": ("sim.scenario", "Scenario"),
    "Summary": ("sim.loop", "RunSummary"),
    "UserError": ("controller.common.errors", "UserError"),
    "design": ("sim.api", "design"),
    "limit": ("sim.api", "limit"),
    "load": ("sim.scenario", "load"),
    "read": ("sim.api", "read"),
    "replay": ("sim.api", "replay"),
    "run": ("sim.api", "run"),
    "run_trials": ("sim.api", "run_trials"),
    "with_value": ("sim.scenario", "with_value"),
    "with_values": ("sim.scenario", "with_values"),
    "write_review": ("sim.api", "write_review"),
}
"""Name -> where it stands."""

__all__ = [
    "ControlStep",
    "Controller",
    "Log",
    "Observation",
    "Scenario",
    "Summary",
    "UserError",
    "__version__",
    "design",
    "limit",
    "load",
    "read",
    "replay",
    "run",
    "run_trials",
    "with_value",
    "with_values",
    "write_review",
]


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        return version("cmpc-walker")
    if name not in _HOMES:
        raise AttributeError(f"module 'sim' has no attribute {name!r}; it has {', '.join(__all__)}")
    module, attribute = _HOMES[name]
    return getattr(importlib.import_module(module), attribute)


def __dir__() -> list[str]:
    return sorted(__all__)
