"""A load on the torso, told from a push by how the links answer to the torque that is held.

The momentum about the stance foot alone cannot tell the two apart within a step (see `observer`). All five equations of
motion can: a push at the torso's centre of mass, of whatever size at whatever tick, moves the links in one direction
only, D^-1 a; what is left of the accelerations across it is the load's, which stays. So

    D (ddphi - ddphi_believed) = F a + m b,    m = sum b' r' / sum b' b'

with b' and r' what D^-1 b and the accelerations' error have across D^-1 a; what is then left along it is F. It needs
the torque, which the observer does not; a motor's error comes out as a load and a push.
"""

import dataclasses
import math

import numpy as np

from controller.belief import WalkerModel, kernels
from controller.belief.linalg import cholesky5_solve
from controller.belief.lumped import lump
from controller.common.compiled import Array, compiled
from controller.common.records import Vector
from controller.plan.dynamics import N_X, Rates, World, accelerate, new_rates

MEMORY = 0.3  # [s] that is looked back
CALM = 0.03  # [s] over which the push is averaged
DOUBT = 0.002  # [rad^2/s^3/kg^2] the integral of b'^2 at which a load is believed by half
BLOW = 0.4  # [m/s] least change of the swing foot's speed in a tick that something it met has made
SURE = 6.0  # times what such changes are by noise
FEW = 20  # ticks that tell nothing of the noise yet
QUANTUM = 0.25  # [kg] a load believed in changes by


@compiled
def _moves(world: World, gyration: float, x: Array, acceleration: Array, stage: kernels.Stage, load: Array) -> None:
    """D^-1 b: how a kilogram of load moves the links that accelerate so; the walker stands factored in `stage`."""
    lever, torso = world.lever, 4
    ddx = ddz = 0.0
    for i in range(5):
        square = x[5 + i] * x[5 + i]
        ddx -= lever[i] * (stage.cos[i] * acceleration[i] - stage.sin[i] * square)
        ddz -= lever[i] * (stage.sin[i] * acceleration[i] + stage.cos[i] * square)
    for i in range(5):
        load[i] = lever[i] * (stage.cos[i] * ddx + stage.sin[i] * (ddz + world.walker.gravity))
    load[torso] -= gyration * acceleration[torso]
    cholesky5_solve(stage.L, load)


@compiled
def weigh(
    bare: World, loaded: World, gyration: float, period: float, x: Array, after: Array, u: Array, stage: kernels.Stage,
    start: Rates, end: Rates,
) -> tuple[float, float, float, float, float]:  # fmt: skip
    """What made the links move as they did in a tick.

    Noise of the rates is in the accelerations measured, so in b' and in r', and would look like a load; b' of the
    accelerations expected is correlated with instead (an instrumental variable).

    Args:
        bare: The walker as believed without load, unpushed.
        loaded: The same with the load believed so far.
        gyration: Square of the torso's radius of gyration in [m^2].
        period: Of a tick in [s].
        x: State at its beginning, (10,).
        after: State at its end, (10,).
        u: Torque held in [N.m], (4,).
        stage: Scratch.
        start: Scratch.
        end: Scratch.

    Returns:
        What moved the links along D^-1 a in [N], and how far a kilogram of load does in [N/kg]; b'^2 and b' r'; and the
        change of the swing foot's speed forward that nothing known explains in [m/s].
    """
    push, load, guess, error, measured = np.empty(5), np.empty(5), np.empty(5), np.empty(5), np.empty(5)
    accelerate(loaded, x, u, stage, False, end)
    expected = end.acceleration.copy()
    accelerate(bare, after, u, stage, False, end)
    accelerate(bare, x, u, stage, False, start)
    for i in range(5):
        measured[i] = (after[5 + i] - x[5 + i]) / period
        error[i] = measured[i] - 0.5 * (start.acceleration[i] + end.acceleration[i])
        push[i] = -bare.lever[i] * stage.cos[i]
    change = 0.0
    for i in range(5):
        change -= bare.walker.reach[i] * stage.cos[i] * error[i] * period
    cholesky5_solve(stage.L, push)
    _moves(bare, gyration, x, measured, stage, load)
    _moves(bare, gyration, x, expected, stage, guess)
    pp = pl = pe = pg = 0.0
    for i in range(5):
        pp += push[i] * push[i]
        pl += push[i] * load[i]
        pe += push[i] * error[i]
        pg += push[i] * guess[i]
    gl = ge = 0.0
    for i in range(5):
        across = guess[i] - pg / pp * push[i]
        gl += across * load[i]
        ge += across * error[i]
    return pe / pp, pl / pp, gl, ge, change


class Scales:
    """Keeps the load and the walker that carries it.

    Attributes:
        load: In [kg].
        push: In [N].
        world: The walker with it, unpushed on level ground.
        gyration: Square of the torso's radius of gyration in [m^2].
        weighs: Whether the last tick told a load: no landing lasts, and no blow came.
        blow: Change of the swing foot's speed in it that is more than noise and that nothing known explains in [m/s],
            forward, or 0.
    """

    def __init__(self, model: WalkerModel, undisturbed: World, period: float, skip: float) -> None:
        """Args: model: the walker; undisturbed: its world; period: of ticks; skip: after a landing, in [s]."""
        self._model, self._bare, self._period = model, undisturbed, period
        self._skip, self._kept = round(skip / period) + 2, float(np.exp(-period / MEMORY))
        self.gyration = model.torso.inertia / model.torso.mass
        self._stage, self._start, self._end = kernels.new_stage(), new_rates(), new_rates()
        self._before = np.zeros(N_X)
        self.reset()

    def reset(self) -> None:
        """Nothing is on the scales."""
        self.load, self.push, self.world = 0.0, 0.0, self._bare
        self.blow = 0.0
        self._noise, self._ticks = 0.0, 0  # mean square of the changes of the foot's speed, and of how many
        self._square = self._product = 0.0  # integrals of b'^2 and b' r' over the time looked back
        self._wait, self.weighs = 1, False

    def update(self, x: Vector, u: Vector, *, stands: bool, exchanged: bool) -> None:
        """Take in a tick.

        Args:
            x: State measured, (10,).
            u: Torque held since the tick before in [N.m], (4,), stance order.
            stands: Whether the stance foot touches the ground.
            exchanged: Whether the legs have just been exchanged.
        """
        if exchanged:
            self._wait = self._skip
        moves = self._wait == 0
        self._wait = max(self._wait - 1, 0)
        self.blow = 0.0
        if moves:
            along, per_load, square, product, change = weigh(
                self._bare, self.world, self.gyration, self._period, self._before, x, u, self._stage, self._start,
                self._end,
            )  # fmt: skip
            self.blow = self._beyond_noise(change)
        self.weighs = moves and stands and self.blow == 0.0
        if not stands or self.blow != 0.0:
            self._wait = self._skip - 1
        if self.weighs:
            self._square = self._kept * self._square + square * self._period
            self._product = self._kept * self._product + product * self._period
            load = self._product / (max(self._square, 0.0) + DOUBT)
            self.push += self._period / CALM * (along - load * per_load - self.push)
            self._believe(load)
        self._before[:] = x

    def _beyond_noise(self, change: float) -> float:
        """A change of the swing foot's speed, or 0 where it is none but for noise."""
        limit = max(BLOW, SURE * math.sqrt(self._noise)) if self._ticks >= FEW else math.inf
        self._ticks += 1
        usual = min(change * change, limit * limit)
        self._noise += max(self._period / MEMORY, 1.0 / self._ticks) * (usual - self._noise)
        return change if abs(change) > limit else 0.0

    def _believe(self, load: float) -> None:
        model, torso = self._model, self._model.torso
        load = QUANTUM * round(max(load, -0.5 * torso.mass) / QUANTUM)
        if load == self.load:
            return
        self.load = load
        heavier = 1.0 + load / torso.mass
        heavy = dataclasses.replace(torso, mass=heavier * torso.mass, inertia=heavier * torso.inertia)
        lumped = lump(heavy, model.femur, model.tibia, model.joints, model.lumped.gravity, model.known)
        self.world = self._bare._replace(walker=lumped)
