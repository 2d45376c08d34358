"""The truth: plants, ground, sensors and motors."""

from sim.plant.body import Walker
from sim.plant.energy import Energy
from sim.plant.mujoco_plant import MujocoPlant
from sim.plant.rigid_plant import RigidPlant

__all__ = [
    "Energy",
    "MujocoPlant",
    "RigidPlant",
    "Walker",
]
