"""What happens in a run, and its TOML files."""

from controller.common.settings import ControllerSettings
from sim.scenario.files import from_toml, load, names_a_path, shipped, to_toml
from sim.scenario.plant import GroundSettings, PlantSettings
from sim.scenario.scenario import Push, Scenario, StartSettings, settings_table, with_value, with_values
from sim.scenario.signals import ActuationSettings, SensorSettings

__all__ = [
    "ActuationSettings",
    "ControllerSettings",
    "GroundSettings",
    "PlantSettings",
    "Push",
    "Scenario",
    "SensorSettings",
    "StartSettings",
    "from_toml",
    "load",
    "names_a_path",
    "settings_table",
    "shipped",
    "to_toml",
    "with_value",
    "with_values",
]
