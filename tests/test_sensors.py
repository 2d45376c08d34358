"""Sensors tell what they should, late by what they should, and noise is what the seed says."""

import dataclasses

import numpy as np
import pytest

from sim.interface import OBSERVATION, Observation, observation_of
from sim.plant.sensors import Sensors
from sim.scenario import SensorSettings
from sim.scenario.per_link import JointAngles, JointRates

PERIOD = 1e-3  # [s]


def truth(k: int) -> Observation:
    t = k * PERIOD
    q = np.array([3.0 + t, 3.1, -0.3, -0.4 + 2 * t, -0.1])
    return Observation(t=t, q=q, dq=np.array([1.0, 0.0, 0.0, 2.0, 0.0]), contact=(k % 2 == 0, k >= 5))


class Reading:
    """Sensors that are read one observation after the other, in blocks of seven rows."""

    def __init__(self, seed: int = 0, **values: object) -> None:
        self._sensors, self._rows, self._k = (
            Sensors(SensorSettings(**values), PERIOD, seed),
            np.zeros(7, OBSERVATION),
            0,
        )

    def read(self, told: Observation) -> Observation:
        i, self._k = self._k % len(self._rows), self._k + 1
        row = self._rows[i]
        row["t"], row["q"], row["dq"], row["contact"] = told.t, told.q, told.dq, told.contact
        self._sensors.read(self._rows, i)
        return observation_of(row)


def read(ticks: int = 20, seed: int = 0, **values: object) -> list[Observation]:
    sensors = Reading(seed, **values)
    return [sensors.read(truth(k)) for k in range(ticks)]


def test_ideal_sensors_tell_the_truth_bit_for_bit() -> None:
    for k, seen in enumerate(read()):
        assert np.array_equal(seen.q, truth(k).q) and np.array_equal(seen.dq, truth(k).dq)
        assert seen.contact == truth(k).contact


def test_biases_and_drift_go_where_they_are_named() -> None:
    seen = read(
        angle_bias=JointAngles(right_hip=0.01),
        rate_bias=JointRates(left_knee=-0.2),
        torso_bias=0.05,
        torso_drift=2.0,
        torso_rate_bias=0.3,
    )[10]
    error = seen.q - truth(10).q
    assert error == pytest.approx([0, 0.01, 0, 0, 0.05 + 2.0 * 10 * PERIOD])
    assert seen.dq - truth(10).dq == pytest.approx([0, 0, -0.2, 0, 0.3])


def test_encoders_round_to_their_step_and_leave_the_torso() -> None:
    step = 0.01
    for k, seen in enumerate(read(angle_resolution=step)):
        assert np.all(np.abs(seen.q[:4] - truth(k).q[:4]) <= step / 2 + 1e-12)
        assert seen.q[:4] / step == pytest.approx(np.round(seen.q[:4] / step), abs=1e-9)
        assert seen.q[4] == truth(k).q[4]


@pytest.mark.parametrize("latency", [1, 3])
def test_latency_delays_the_whole_reading(latency: int) -> None:
    for k, seen in enumerate(read(latency=latency)):
        then = truth(max(0, k - latency))
        assert np.array_equal(seen.q, then.q) and seen.contact == then.contact
        assert seen.t == truth(k).t


def test_contact_delay_delays_the_flags_alone() -> None:
    for k, seen in enumerate(read(contact_delay=2)):
        assert seen.contact == truth(max(0, k - 2)).contact
        assert np.array_equal(seen.q, truth(k).q)


def test_dropouts_lower_raised_flags_at_their_rate() -> None:
    sensors = Reading(seed=3, contact_dropout=0.2)
    up = dataclasses.replace(truth(0), contact=(True, True))
    down = dataclasses.replace(truth(0), contact=(False, False))
    lost = np.mean([1 - np.mean(sensors.read(up).contact) for _ in range(5000)])
    assert lost == pytest.approx(0.2, abs=0.02)
    assert not any(any(sensors.read(down).contact) for _ in range(100))


def test_noise_has_its_deviation_and_no_mean() -> None:
    sensors = Reading(seed=1, angle_noise=0.01, rate_noise=0.2, torso_noise=0.03, torso_rate_noise=0.4)
    seen = [sensors.read(truth(0)) for _ in range(20_000)]
    angles, rates = (np.array([getattr(s, name) - getattr(truth(0), name) for s in seen]) for name in ("q", "dq"))
    deviations = np.array([0.01] * 4 + [0.03])
    assert angles.std(axis=0) == pytest.approx(deviations, rel=0.03)
    assert np.abs(angles.mean(axis=0)) == pytest.approx(0, abs=0.001)
    assert rates.std(axis=0) == pytest.approx([0.2] * 4 + [0.4], rel=0.03)


def test_equal_seeds_are_equal_and_sources_do_not_disturb_each_other() -> None:
    plain = read(seed=5, angle_noise=0.01)
    again = read(seed=5, angle_noise=0.01)
    more = read(seed=5, angle_noise=0.01, rate_noise=0.1, contact_dropout=0.3, torso_noise=0.1)
    other = read(seed=6, angle_noise=0.01)
    for a, b, c, d in zip(plain, again, more, other, strict=True):
        assert np.array_equal(a.q, b.q) and np.array_equal(a.q[:4], c.q[:4])
        assert not np.array_equal(a.q, d.q)


def test_differentiated_rates_are_those_of_a_straight_line_and_the_filter_is_first_order() -> None:
    assert read(rates="differentiated")[10].dq == pytest.approx(truth(10).dq, abs=1e-9)
    sensors = Reading(rates="differentiated", rate_cutoff=20.0)
    still = dataclasses.replace(truth(0), dq=np.zeros(5))
    sensors.read(still)
    k = 8  # ticks after a jump of the rate from 0 to 1 rad/s
    for i in range(1, k + 1):
        seen = sensors.read(dataclasses.replace(still, q=still.q + i * PERIOD))
    assert seen.dq == pytest.approx(1 - np.exp(-2 * np.pi * 20.0 * k * PERIOD), rel=1e-9)
