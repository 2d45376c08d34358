"""Pushes act when they should, with the force they should."""

import math

import pytest

from sim.loop.pushes import PERIOD, Pushes
from sim.scenario import Push

COM = {"torso": (0.0, 0.24), "left_tibia": (0.0, 0.2)}


def active_forces(pushes, t, step, com, *, step_began=0.0, period=PERIOD):
    those = Pushes(pushes, com, period)
    assert those.look(t, step, step_began) == bool(those.applied)
    return those.applied


def test_nothing_is_active_without_pushes() -> None:
    assert active_forces((), 0.0, 1, COM) == ()


@pytest.mark.parametrize(("step", "acts"), [(1, False), (2, True), (3, False)])
def test_a_push_by_step_lasts_that_step(step: int, acts: bool) -> None:
    assert bool(active_forces((Push(force=25.0, step=2),), 0.7, step, COM)) is acts


def test_a_push_by_time_lasts_a_whole_number_of_ticks() -> None:
    period = 1e-3  # [s]
    push = Push(force=1.0, start=0.057, end=0.113)
    ticks = [k for k in range(200) if active_forces((push,), k * period, 1, COM)]
    assert ticks == list(range(57, 113))


def test_a_push_without_point_attacks_the_centre_of_mass() -> None:
    (force,) = active_forces((Push(force=25.0, step=1),), 0.0, 1, COM)
    assert (force.body, force.point, force.force) == ("torso", (0.0, 0.24), (25.0, 0.0))


def test_direction_is_counter_clockwise_from_forward() -> None:
    push = Push(force=10.0, direction=math.pi / 2, body="left_tibia", point=(0.01, 0.3), step=1)
    (force,) = active_forces((push,), 0.0, 1, COM)
    assert force.force == pytest.approx((0.0, 10.0))
    assert force.point == (0.01, 0.3)


def test_pushes_that_act_together_all_act() -> None:
    pushes = (Push(force=1.0, step=1), Push(force=2.0, start=0.0, end=1.0), Push(force=3.0, step=2))
    assert [force.force[0] for force in active_forces(pushes, 0.5, 1, COM)] == [1.0, 2.0]


@pytest.mark.parametrize("duration", [0.01, 0.0103, 0.0004])
def test_an_impulse_is_delivered_whole_from_the_start_of_its_step(duration: float) -> None:
    period, began = 1e-3, 0.5  # [s]
    push = Push(impulse=-3.0, duration=duration, step=2)
    total = 0.0  # [N.s]
    for k in range(400, 700):
        step = 2 if k * period >= began else 1
        forces = active_forces((push,), k * period, step, COM, step_began=began if step == 2 else 0.0)
        assert not forces or k * period >= began - 1e-9
        total += sum(force.force[0] for force in forces) * period
    assert total == pytest.approx(-3.0)
