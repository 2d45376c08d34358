"""Part of the composition root: what a controller believes, and the controller a scenario asks for."""

import functools
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from controller.belief import Gait, WalkerModel, kernels, load_gait
from controller.cmpc import CascadedMpc, ZeroDynamicsController
from controller.cmpc.cascade import PENALTY, Friction, Weights
from controller.qp import Solver, make_solver
from controller.qp.problem import ROWS
from sim.interface import Controller
from sim.scenario import ControllerSettings, Scenario
from sim.walkers import ModelFiles

if TYPE_CHECKING:
    from controller.fitting.controller import Follower
    from controller.fitting.family import GaitFamily


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


def load_belief(scenario: Scenario, files: ModelFiles | None = None) -> Belief:
    """The controller's model and gait.

    Args:
        scenario: What happens.
        files: Model files to use instead of those the scenario names.

    Raises:
        UserError: a file is missing, unreadable or not legal.
    """
    files = files or ModelFiles.of(scenario)
    model = WalkerModel(files.urdf)
    return Belief(model=model, gait=load_gait(files.gait, model), library=files.library)


@functools.lru_cache(maxsize=4)
def known_belief(walker: str, gait: str) -> Belief:
    """The controller's model and gait, read once a process: a campaign runs thousands of scenarios."""
    return load_belief(Scenario(walker=walker, gait=gait))


def build_controller(settings: ControllerSettings, belief: Belief, *, solver: Solver | None = None) -> Controller:
    """The controller a scenario asks for.

    Args:
        settings: Its settings.
        belief: What it knows about the walker.
        solver: Used instead of the one the settings name.

    Raises:
        UserError: unknown solver, or no gait library where gaits are fitted.
    """
    law = _law(settings, belief, solver)
    fitting = settings.gait_fitting
    if not fitting.enabled:
        return law
    from controller.fitting.controller import FittingRule, GaitFitting

    rule = FittingRule(
        share=fitting.share,
        slower=fitting.slower,
        faster=fitting.faster,
        hysteresis=fitting.hysteresis,
        most=fitting.most,
    )
    return GaitFitting(law, belief.model, _family(belief), rule)


@functools.lru_cache(maxsize=4)
def _family(belief: Belief) -> "GaitFamily":
    from controller.fitting.family import GaitFamily
    from controller.fitting.library import GaitLibrary

    return GaitFamily.around(belief.gait, GaitLibrary.load(belief.library, belief.model))


def _law(settings: ControllerSettings, belief: Belief, solver: Solver | None) -> "Follower":
    gains = kernels.Gains(kp=np.array(settings.kp), kd=np.array(settings.kd))
    if settings.kind == "zd-pd":
        return ZeroDynamicsController(belief.model, belief.gait, gains)
    if settings.kind == "c-mpc-ltv":
        return _ltv_cascade(settings, belief, gains)
    if settings.kind in ("clf-qp", "output-mpc"):
        return _rival(settings, belief, gains)
    return CascadedMpc(
        belief.model,
        belief.gait,
        gains,
        N=settings.horizon,
        T=settings.period,
        weights=_weights(settings, gains),
        friction=_friction(settings),
        solver=solver or make_solver(settings.solver, settings.horizon, ROWS if settings.friction_rows else 0),
    )


def _friction(settings: ControllerSettings, penalty: float = PENALTY) -> Friction | None:
    """The contact-force limits a scenario asks for, None for none."""
    if not settings.friction_rows:
        return None
    return Friction(mu=settings.friction, normal_min=settings.normal_force_min, penalty=penalty)


def _weights(settings: ControllerSettings, gains: kernels.Gains) -> Weights:
    """The paper's cost with the factors a scenario puts on it."""
    paper, factors = Weights.of_paper(gains, settings.period), settings.weights
    return Weights(
        Q_position=np.array(factors.output) * paper.Q_position,
        Q_velocity=np.array(factors.output_rate) * paper.Q_velocity,
        R=np.array(factors.torque) * paper.R,
    )


def _ltv_cascade(settings: ControllerSettings, belief: Belief, gains: kernels.Gains) -> "Follower":
    from controller.ltv.cascade import LtvCascade, LtvWeights  # compiled only where it is used

    ltv = settings.ltv
    return LtvCascade(
        belief.model,
        belief.gait,
        gains,
        period=settings.period,
        stages=ltv.stages,
        stage_time=ltv.stage_time,
        substeps=ltv.substeps,
        weights=LtvWeights(
            output=ltv.output,
            output_calm=ltv.output_calm,
            calm=ltv.calm,
            output_rate=ltv.output_rate,
            clock_rate=ltv.clock_rate,
            torque=ltv.torque,
            last=ltv.last,
            torque_penalty=ltv.torque_penalty,
        ),
        friction=_friction(settings, ltv.force_penalty),
        slope_memory=ltv.slope_memory,
    )


def _rival(settings: ControllerSettings, belief: Belief, gains: kernels.Gains) -> "Follower":
    from controller.rivals.clf_qp import ClfQp, Lyapunov
    from controller.rivals.law import Law, OutputController
    from controller.rivals.output_mpc import OutputMpc

    limit = belief.model.torque_limits
    law: Law
    if settings.kind == "clf-qp":
        clf = settings.clf
        law = ClfQp(
            Lyapunov.rapid(clf.epsilon),
            penalty=clf.penalty,
            limit=limit,
            friction=_friction(settings, clf.force_penalty),
        )
    else:
        mpc = settings.output_mpc
        law = OutputMpc(
            N=mpc.stages,
            T=mpc.stage_time,
            output=mpc.output,
            output_rate=mpc.output_rate,
            limit=limit,
            period=settings.period,
        )
    return OutputController(belief.model, belief.gait, gains, law)
