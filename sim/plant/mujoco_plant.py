"""MuJoCo walker: the truth. Named access is resolved once; a tick is compiled code on MuJoCo's memory."""

import logging
import math

import mujoco
import numpy as np
from numpy.typing import NDArray

from controller.common.entry import Bound, bind
from sim.errors import PlantDiverged
from sim.interface import COORDINATES, FEET, LINKS, Rows, Vector
from sim.plant import mujoco_kernels as kernels
from sim.plant.body import DETECTED_LINKS, Body, check_start, no_torque
from sim.plant.engine import address
from sim.plant.rows import DIVERGED, FINE, NO_TORQUE
from sim.scenario import PlantSettings

FOOTHOLD_DEPTH = 1e-6  # [m], half the depth at rest: at reset the stance foot is sensed as touching

logger = logging.getLogger(__name__)


def _quiet(text: str) -> None:
    """Take MuJoCo's warnings to the log: by default it prints them and writes MUJOCO_LOG.TXT."""
    logger.debug("MuJoCo: %s", text)


class MujocoPlant(Body):
    """Five-link walker with point feet on compliant frictional ground. Implements `sim.interface.Plant`."""

    def _refuse(self, settings: PlantSettings) -> None:
        """Refuse nothing: MuJoCo has all that can be set."""

    def _prepare(self) -> None:
        """Resolve where everything stands in MuJoCo's memory."""
        mujoco.set_mju_user_warning(_quiet)
        model, data = self.model, self.data

        def joint(name: str) -> int:
            return int(model.jnt_qposadr[model.joint(name).id])

        def sensor(name: str) -> int:
            return int(model.sensor_adr[model.sensor(name).id])

        self._hip_index = [joint("hip_x"), joint("hip_z")]
        self._q_index = [joint(name) for name in COORDINATES]
        self._radius = float(model.geom("left_foot").size[0])  # [m]
        self._qpos, self._qvel = data.qpos, data.qvel  # live views, written only
        self._warnings = number = data.warning.number
        assert number.itemsize == 4 and number.strides == (number.itemsize * kernels.WARNING_STRIDE,)
        self._state_size = mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_INTEGRATION)
        self._work = work = np.zeros(1, kernels.WORK)
        work["model"], work["data"] = model._address, data._address
        work["qpos"], work["qvel"], work["ctrl"] = address(data.qpos), address(data.qvel), address(data.ctrl)
        work["sensors"], work["actuator_force"] = address(data.sensordata), address(data.actuator_force)
        work["xfrc"], work["warnings"], work["nwarning"] = address(data.xfrc_applied), address(number), len(number)
        work["nq"], work["nu"], work["nbody"], work["nsensordata"] = model.nq, model.nu, model.nbody, model.nsensordata
        work["hip"], work["q"], work["u"] = self._hip_index, self._q_index, self._actuators
        work["feet"], work["bodies"] = [sensor(name) for name in FEET], self._body_ids
        work["links"] = [sensor(name) if name in DETECTED_LINKS else -1 for name in LINKS]
        work["com"], work["lengths"] = [self.com[name] for name in LINKS], self.legs.lengths
        work["radius"], work["period"], work["substeps"] = self._radius, self.period, self.substeps

    def integration_state(self) -> Vector:
        """All that the next step depends on (mjSTATE_INTEGRATION), a copy in SI units, (model's size,)."""
        state = np.empty(self._state_size)
        mujoco.mj_getState(self.model, self.data, state, mujoco.mjtState.mjSTATE_INTEGRATION)
        return state

    def reset(self, q: Vector, dq: Vector, stance: str) -> None:
        """Put the walker on its stance foot.

        The tip of the stance tibia is put at x = 0, at rest, the foot's sphere in the ground by a micrometre.
        The other foot is where `q` puts it, even if that is below the ground.

        Args:
            q: Joint angles and torso angle in [rad], (5,), ordered as `COORDINATES`.
            dq: Their rates in [rad/s], (5,).
            stance: "left" or "right".

        Raises:
            UserError: `stance` is not a leg, or an angle or a rate is not finite.
        """
        leg = check_start(q, dq, stance)
        mujoco.mj_resetData(self.model, self.data)
        self._qpos[self._q_index], self._qvel[self._q_index] = q, dq
        x, z = self.legs.feet(q.tolist())[leg]
        dx, dz = self.legs.feet_velocity(q.tolist(), dq.tolist())[leg]
        ground = self.terrain.under(0.0)
        above = (self._radius - FOOTHOLD_DEPTH) / math.cos(ground.angle)  # [m], of the sphere's centre
        self._qpos[self._hip_index] = -x, above + self.terrain.height(0.0) - z
        self._qvel[self._hip_index] = -dx, -dz
        mujoco.mj_forward(self.model, self.data)
        self._begin()

    def look(self, state: Rows, seen: Rows, i: int) -> None:
        """Fill row `i` of `state` with the truth now and of `seen` with what ideal sensors read; see `Plant`."""
        kernels.look(self._work, self._ground, state, seen, i)

    def move(self, step: Rows, i: int, acting: NDArray[np.bool_]) -> None:
        """Hold what row `i` commands, forces at their points' positions when the hold starts; see `Plant`.

        Raises:
            ValueError: the torque is not finite: a defect of the controller.
            PlantDiverged: the state is not finite any more, or MuJoCo warned.
        """
        end = kernels.move(self._work, step, i, self._forces, acting)
        if end != FINE:
            self.heed(end, step, i)

    def heed(self, end: int, step: Rows, i: int) -> None:
        """Say what was wrong with the hold of row `i`; raises as `move` does."""
        if end == NO_TORQUE:
            raise no_torque(step[i]["u_total"])
        if end == DIVERGED:
            raise PlantDiverged(self._diagnosis())

    def bound(self, state: Rows, seen: Rows, step: Rows, acting: NDArray[np.bool_]) -> tuple[Bound, Bound] | None:
        """The kernels of `look` and `move` for `sim.loop.ride`, with these forces and rows of these types."""
        if type(self) is not MujocoPlant:
            return None  # one that may do more
        look = bind(kernels.look, (self._work, self._ground), (state, seen, 0))
        return look, bind(kernels.move, (self._work,), (step, 0, self._forces, acting))

    def _begin(self) -> None:
        work = self._work
        work["ticks"], work["force"], work["push"], work["pushed"] = 0, 0.0, 0.0, False
        self._applied = ()

    def _diagnosis(self) -> str:
        number, info = self._warnings.tolist(), self.data.warning.lastinfo.tolist()
        warnings = [mujoco.mju_warningText(kind, info[kind]) for kind, count in enumerate(number) if count]
        detail = "; ".join(warnings) or f"qpos = {self._qpos.tolist()}, qvel = {self._qvel.tolist()}"
        t = self._work["ticks"][0] * self.period
        return f"the plant diverged in the hold up to t = {t:.3f} s: {detail}"
