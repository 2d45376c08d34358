"""Motors do what they are asked, late, rounded, weak or noisy as their settings say."""

import numpy as np
import pytest

from sim.interface import STEP
from sim.plant.actuation import Actuation
from sim.scenario import ActuationSettings
from sim.scenario.per_link import JointFactors

PERIOD = 1e-3  # [s]
COMMANDS = [np.array([k, -k, 2.0 * k, 1.0]) for k in range(12)]


class Motors:
    """Motors that are given one command after the other, in blocks of five rows."""

    def __init__(self, seed: int = 0, **values: object) -> None:
        self._motors = Actuation(ActuationSettings(**values), PERIOD, seed)
        self._rows, self._k = np.zeros(5, STEP), 0

    def apply(self, u: np.ndarray) -> np.ndarray:
        i, self._k = self._k % len(self._rows), self._k + 1
        self._rows["u_total"][i] = u
        self._motors.apply(self._rows, i)
        return self._motors.torque["u_total"][0].copy()


def apply(seed: int = 0, **values: object) -> list[np.ndarray]:
    motors = Motors(seed, **values)
    return [motors.apply(u) for u in COMMANDS]


def test_ideal_motors_give_what_is_asked() -> None:
    for asked, given in zip(COMMANDS, apply(), strict=True):
        assert np.array_equal(asked, given)


def test_latency_is_a_whole_number_of_ticks() -> None:
    for k, given in enumerate(apply(latency=3)):
        assert np.array_equal(given, COMMANDS[max(0, k - 3)])


def test_motor_constant_scales_its_own_joint() -> None:
    given = apply(motor_constant_factor=JointFactors(right_hip=0.5))[4]
    assert given == pytest.approx([4, -2, 8, 1])


def test_commands_round_to_the_resolution() -> None:
    assert apply(resolution=3.0)[4] == pytest.approx([3, -3, 9, 0])


def test_lag_answers_a_step_with_its_time_constant() -> None:
    motors = Motors(lag=0.02)
    motors.apply(np.zeros(4))
    for _ in range(20):
        given = motors.apply(np.full(4, 10.0))
    assert given == pytest.approx(10 * (1 - np.exp(-1)))


def test_noise_is_seeded_and_has_its_deviation() -> None:
    first, again, other = apply(noise=2.0), apply(noise=2.0), apply(noise=2.0, seed=1)
    assert np.array_equal(first, again) and not np.array_equal(first, other)
    motors = Motors(noise=2.0)
    errors = np.array([motors.apply(np.zeros(4)) for _ in range(20_000)])
    assert errors.std(axis=0) == pytest.approx([2.0] * 4, rel=0.03)
    assert errors.mean(axis=0) == pytest.approx([0.0] * 4, abs=0.05)


def test_a_command_reused_by_the_controller_does_not_change_the_past() -> None:
    motors = Motors(latency=1)
    buffer = np.ones(4)
    motors.apply(buffer)
    buffer[:] = 7.0
    assert motors.apply(buffer) == pytest.approx(np.ones(4))
