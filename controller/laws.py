"""The laws by name: one factory each, from its settings and what the controller believes to a controller."""

import dataclasses
import functools
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from controller.belief import Friction, Gains, Gait, Law, StanceEstimator, WalkerModel, load_gait
from controller.belief.friction import PENALTY, ROWS, UNLIMITED
from controller.cmpc import CascadedMpc, ZeroDynamicsController
from controller.cmpc.program import Weights
from controller.common import outside
from controller.common.records import Controller
from controller.common.settings import BUILT_IN, ControllerSettings
from controller.guard import Guarded
from controller.observer import Observed, PushObserver
from controller.qp import Solver, make_solver

if TYPE_CHECKING:
    from controller.fitting.family import GaitFamily
    from controller.ltv.cascade import LtvCascade


@dataclass(frozen=True, slots=True, kw_only=True)
class Belief:
    """What the controller knows about the walker.

    Attributes:
        model: Analytic model.
        gait: The gait to follow.
        library: Folder of the gait library.
    """

    model: WalkerModel
    gait: Gait
    library: Path

    @classmethod
    def load(cls, urdf: Path, gait: Path, library: Path) -> "Belief":
        """Read the files.

        Raises:
            UserError: a file is missing, unreadable or not legal.
        """
        model = WalkerModel(urdf)
        return cls(model=model, gait=load_gait(gait, model), library=library)


def build(settings: ControllerSettings, belief: Belief, *, solver: Solver | None = None) -> Controller:
    """The controller that settings ask for.

    Args:
        settings: Its settings.
        belief: What it knows about the walker.
        solver: Used instead of the one the settings name.

    Raises:
        UserError: unknown solver, or no gait library where gaits are fitted.
    """
    if settings.knows != belief.model.known:
        belief = dataclasses.replace(belief, model=belief.model.knowing(settings.knows))
    observer = PushObserver(belief.model, settings.observer, period=settings.period, impact_time=settings.impact_time)
    asks = settings.observer.enabled
    if settings.kind == "c-mpc":
        law: Law | Guarded = _c_mpc(settings, belief, solver)
    elif settings.kind == "c-mpc-plan":
        law = _c_mpc_plan(settings, belief, observer)
        asks = True
    elif settings.kind in BUILT_IN:
        law = _FACTORIES[settings.kind](settings, belief)
    else:
        law = _from_outside(settings, belief, observer)
        asks = asks or outside.asks_for(outside.find(settings.kind), "observer")
    if isinstance(law, Law):
        law.stance = StanceEstimator(belief.model, impact_time=settings.impact_time)
    controller: Controller = law
    if settings.gait_fitting.enabled:
        from controller.fitting.controller import GaitFitting

        controller = GaitFitting(law, belief.model, _family(belief), settings.gait_fitting)
    if not asks:
        return controller
    return Observed(controller, observer, StanceEstimator(belief.model, impact_time=settings.impact_time))


@functools.lru_cache(maxsize=4)
def _family(belief: Belief) -> "GaitFamily":
    from controller.fitting.family import GaitFamily
    from controller.fitting.library import GaitLibrary

    return GaitFamily.around(belief.gait, GaitLibrary.load(belief.library, belief.model))


def _gains(settings: ControllerSettings) -> Gains:
    return Gains(kp=np.array(settings.kp), kd=np.array(settings.kd))


def _friction(settings: ControllerSettings, penalty: float = PENALTY) -> Friction | None:
    """The contact-force limits that settings ask for, None for none."""
    if not settings.friction_rows:
        return None
    return Friction(mu=settings.friction, normal_min=settings.normal_force_min, penalty=penalty)


def _c_mpc(settings: ControllerSettings, belief: Belief, solver: Solver | None) -> Law:
    gains, N, T = _gains(settings), settings.horizon, settings.period
    return CascadedMpc(
        belief.model,
        belief.gait,
        gains,
        N=N,
        T=T,
        weights=Weights.of_paper(gains, T).times(settings.weights),
        friction=_friction(settings),
        solver=solver or make_solver(settings.solver, N, ROWS if settings.friction_rows else 0),
    )


def _zd_pd(settings: ControllerSettings, belief: Belief) -> Law:
    return ZeroDynamicsController(belief.model, belief.gait, _gains(settings))


def _from_outside(settings: ControllerSettings, belief: Belief, observer: PushObserver) -> Guarded:
    """A controller by its name; its factory may ask for model, gait, observer and every setting of all controllers."""
    found = outside.find(settings.kind)
    common = {field.name: getattr(settings, field.name) for field in dataclasses.fields(ControllerSettings)}
    offers = common | {"model": belief.model, "gait": belief.gait, "observer": observer}
    inner = outside.call(found, offers, getattr(settings, "settings", None) or (found.settings and found.settings()))
    return Guarded(inner, found, belief.model, belief.gait)


# Modules below are imported, and their kernels compiled, only where they are used.


def _c_mpc_ltv(settings: ControllerSettings, belief: Belief) -> "LtvCascade":
    from controller.ltv.cascade import LtvCascade

    return LtvCascade(
        belief.model,
        belief.gait,
        _gains(settings),
        period=settings.period,
        settings=settings.ltv,
        friction=_friction(settings, settings.ltv.force_penalty),
    )


def _c_mpc_plan(settings: ControllerSettings, belief: Belief, observer: PushObserver) -> Law:
    from controller.plan.cascade import PlanCascade

    friction = _friction(settings) or UNLIMITED
    calm = _c_mpc_ltv(settings, belief)
    return PlanCascade(calm, settings.plan, friction, observer, period=settings.period)


def _clf_qp(settings: ControllerSettings, belief: Belief) -> Law:
    from controller.rivals.clf_qp import ClfQp
    from controller.rivals.law import OutputController

    friction = _friction(settings, settings.clf.force_penalty)
    law = ClfQp.of(settings.clf, limit=belief.model.torque_limits, friction=friction)
    return OutputController(belief.model, belief.gait, _gains(settings), law)


def _output_mpc(settings: ControllerSettings, belief: Belief) -> Law:
    from controller.rivals.law import OutputController
    from controller.rivals.output_mpc import OutputMpc

    law = OutputMpc(settings.output_mpc, limit=belief.model.torque_limits, period=settings.period)
    return OutputController(belief.model, belief.gait, _gains(settings), law)


_FACTORIES: dict[str, Callable[[ControllerSettings, Belief], Law]] = {
    "zd-pd": _zd_pd,
    "c-mpc-ltv": _c_mpc_ltv,
    "clf-qp": _clf_qp,
    "output-mpc": _output_mpc,
}
