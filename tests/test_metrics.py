"""The figures of a run, against their definitions."""

import dataclasses
import math

import numpy as np
import pytest
from fakes import control_step, one_tick, plant_state, rows_of

from sim.loop import FallCriteria, FallReason, Judge, Outcome
from sim.loop.judge import TouchDown
from sim.loop.metrics import Durations, Metrics

LIMITS = np.array([75.0, 75.0, 50.0, math.inf])


def summary(metrics, **changes):
    given = dict(
        outcome=Outcome.COMPLETED,
        reason=FallReason.NONE,
        detail="",
        final=rows_of(plant_state(t=2.0))[0],
        wall_s=1.0,
        torque_limits=LIMITS,
        criteria=FallCriteria(),
        log="x.mcap",
    )
    return metrics.summary(**{**given, **changes})


def take(metrics, judge, state, step, tick_s):
    """Judge a tick and add it to the figures."""
    ticks = one_tick(0, state, None, step, tick_s)
    judge.look(ticks.state, ticks.judged, 0)
    metrics.take(ticks)


@pytest.fixture
def judge():
    return Judge("left")


def test_figures_are_their_definitions(judge):
    rng = np.random.default_rng(0)
    metrics = Metrics()
    y, zd, mpc, torque = (rng.normal(size=(50, 4)) for _ in range(4))
    for k in range(50):
        state = plant_state(t=0.1 + k * 1e-3, torque=torque[k])
        step = control_step(y=y[k], u_zd=zd[k], u_mpc=mpc[k], fallback=k % 10 == 0, slack=k / 7)
        take(metrics, judge, state, step, 1e-4)
    found = summary(metrics)
    assert found.output_error_rms_rad == pytest.approx(np.sqrt(np.mean(y**2)))
    assert found.mpc_torque_share == pytest.approx(np.sqrt(np.mean(mpc**2) / np.mean(zd**2)))
    assert list(found.peak_torque_Nm.values()) == pytest.approx(np.abs(torque).max(axis=0))
    assert found.torque_limit_Nm == {"left_hip": 75.0, "right_hip": 75.0, "left_knee": 50.0}
    assert found.fallbacks == 5 and found.slack_max_N == 7.0
    assert found.realtime_factor == 2.0 and found.log == "x.mcap"


def test_friction_is_that_of_the_stance_foot_outside_impacts(judge):
    metrics = Metrics()

    def tick(t, left, right=(0.0, 0.0), **more):
        state = plant_state(t=t, contact_force=np.array([left, right]), **more)
        take(metrics, judge, state, control_step(), 0.0)
        return summary(metrics).friction_ratio_max

    assert tick(0.01, (300.0, 100.0)) == 0.0  # within 20 ms of the start
    assert tick(0.1, (30.0, 100.0)) == pytest.approx(0.3)
    assert tick(0.2, (-50.0, 100.0)) == pytest.approx(0.5)  # either way
    assert tick(0.3, (10.0, 100.0), right=(90.0, 100.0)) == pytest.approx(0.5)  # not the swing foot's
    assert tick(0.4, (9.0, 0.0)) == pytest.approx(0.5)  # no force, no ratio
    ahead = {"foot": np.array([[0.0, 0.0], [0.4, 0.0]]), "contact": (True, True)}
    tick(0.5, (0.0, 1.0), right=(90.0, 100.0), **ahead)
    assert tick(0.51, (0.0, 1.0), right=(80.0, 100.0), **ahead) == pytest.approx(0.5)  # the impact
    assert tick(0.53, (0.0, 1.0), right=(60.0, 100.0), **ahead) == pytest.approx(0.6)


def test_steps_are_averaged():
    metrics = Metrics()
    for number, (duration, length) in enumerate([(0.5, 0.40), (0.6, 0.42)], start=1):
        metrics.touch_down(TouchDown(number=number, t=1.0, duration=duration, length=length, foot="left"))
    found = summary(metrics)
    assert (found.steps, found.step_time_s, found.step_length_m) == (2, pytest.approx(0.55), pytest.approx(0.41))


def test_what_does_not_exist_is_none():
    found = summary(Metrics(), wall_s=0.0)
    assert (found.step_time_s, found.step_length_m, found.friction_ratio_max) == (None, None, None)
    assert (found.output_error_rms_rad, found.mpc_torque_share) == (None, None)
    assert found.realtime_factor == 0.0


def test_a_fall_says_why_and_an_interruption_has_a_message():
    fell = summary(Metrics(), outcome=Outcome.FELL, reason=FallReason.HIP_LOW, detail="0.4 m")
    assert fell.outcome == "fell" and fell.fall_reason == f"{FallReason.HIP_LOW.value} (0.4 m)"
    assert fell.message == ""
    stopped = summary(Metrics(), outcome=Outcome.INTERRUPTED, detail="interrupted by SIGINT")
    assert (stopped.outcome, stopped.fall_reason, stopped.message) == ("interrupted", "", "interrupted by SIGINT")


def test_every_field_of_the_summary_is_plain_data():
    """So that JSON holds it; NumPy scalars are not."""
    metrics = Metrics()
    take(metrics, Judge("left"), plant_state(t=0.1), control_step(solve_s=1e-3), 1e-3)

    def plain(value):
        if isinstance(value, dict):
            return all(plain(v) for v in value.values())
        return value is None or type(value) in (str, int, float)

    for name, value in dataclasses.asdict(summary(metrics)).items():
        assert plain(value), (name, type(value))


def test_quantiles_are_those_of_the_sample_within_a_percent():
    rng = np.random.default_rng(1)
    sample = rng.lognormal(math.log(1e-3), 1.0, 5000)
    durations = Durations()
    for seconds in sample:
        durations.add([float(seconds)])
    for fraction in (0.1, 0.5, 0.9, 0.99):
        assert durations.quantile(fraction) == pytest.approx(np.quantile(sample, fraction), rel=0.015)
    assert durations.milliseconds()["max"] == pytest.approx(1e3 * sample.max(), abs=1e-4)


def test_quantiles_of_nothing_and_of_the_extremes():
    durations = Durations()
    assert durations.quantile(0.5) == 0.0
    for seconds in (0.0, 1e-9, 1e6):
        durations.add([seconds])
    assert durations.milliseconds()["max"] == pytest.approx(1e9)
    assert 0.0 <= durations.quantile(0.1) <= durations.quantile(0.99) <= 1e6
