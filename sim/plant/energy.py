"""Mechanical energy of a walker, as the plant's own model has it."""

import mujoco
import numpy as np

from sim.interface import COORDINATES, Vector


class Energy:
    """Energies of states, by a compiled model; the data are used up by it."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData | None = None) -> None:
        """Args: model: of the plant, errors of its parameters included; data: to work in, else some of its own."""
        self._model = model
        self._data = mujoco.MjData(model) if data is None else data
        names = ("hip_x", "hip_z", *COORDINATES)
        self._at = [int(model.jnt_qposadr[model.joint(name).id]) for name in names]
        self._weight = -float(model.opt.gravity[2]) * float(model.body_subtreemass[0])  # [N]

    def place(self, q: Vector, dq: Vector, hip: Vector, dhip: Vector) -> None:
        """Put the data into a state: angles (5,) in [rad], hip (x, z) in [m], and their rates."""
        data = self._data
        data.qpos[self._at], data.qvel[self._at] = np.concatenate((hip, q)), np.concatenate((dhip, dq))
        mujoco.mj_kinematics(self._model, data)
        mujoco.mj_comPos(self._model, data)

    def now(self) -> tuple[float, float]:
        """Potential and kinetic energy of the data as they are in [J]."""
        model, data = self._model, self._data
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_crb(model, data)
        mujoco.mj_energyPos(model, data)
        mujoco.mj_comVel(model, data)
        mujoco.mj_energyVel(model, data)
        potential, kinetic = data.energy.tolist()
        return potential, kinetic

    def about(self, q: Vector, dq: Vector, hip: Vector, dhip: Vector, height: float) -> float:
        """Energy of a state in [J], heights counted from a foot that is `height` [m] high."""
        self.place(q, dq, hip, dhip)
        return sum(self.now()) - self._weight * height

    def kinetic(self, q: Vector, dq: Vector, hip: Vector, dhip: Vector) -> float:
        """Kinetic energy of a state in [J]."""
        self.place(q, dq, hip, dhip)
        return self.now()[1]
