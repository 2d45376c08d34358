"""What broke: each symptom is found on a run made to show it, the first one wins, and healthy walks show none."""

import dataclasses
import json
import math

import numpy as np
import pytest
from fakes import control_step, plant_state, tell

from sim.bridge.run import build_plant, known_belief, run_scenario
from sim.scenario import Scenario, load, with_values
from sim.settings.tree import spec_at
from sim.trials.falls.cause import PROOFS, Cause, decisive
from sim.trials.falls.witness import SHARES, Witness

DT = 1e-3  # [s]
LIMIT = 150.0  # [N.m]
END = 1.0  # [s]
BEGAN = 0.8  # [s], when a symptom begins


def walk(*changes, end=END, landings=(0.5,)):
    """A witness of a made-up walk; each change is a function of t that gives (state's fields, step's fields)."""
    witness = Witness(DT)
    for k in range(round(end / DT)):
        t = k * DT
        if any(abs(t - landing) < DT / 2 for landing in landings):
            witness.event(k, "info", "impact", "")
        stance = sum(t >= landing - DT / 2 for landing in landings) % 2
        contact = (stance == 0, stance == 1)
        step = {"dtheta": 1.0, "s": (t % 0.5) / 0.5, "y": np.full(4, 0.01)}
        state = {"t": t, "contact": contact, "torque": np.full(4, 50.0), "clearance": np.array([0.0, 0.02])}
        for change in changes:
            more_state, more_step = change(t)
            state |= more_state
            step |= more_step
        tell(witness, k, plant_state(**state), None, control_step(**step), 0.0)
    return witness


def verdict(*changes, **options):
    return walk(*changes, **options).verdict(np.full(4, LIMIT))


def from_(began, state=None, step=None, until=math.inf):
    """A change that holds from a time on; values may be functions of t."""

    def made(values, t):
        return {name: value(t) if callable(value) else value for name, value in (values or {}).items()}

    return lambda t: (made(state, t), made(step, t)) if began <= t < until else ({}, {})


SLIDE = {"foot": lambda t: np.array([[0.0, 0.0], [-0.2 + 0.3 * (t - BEGAN), 0.1]])}
SYMPTOMS = {
    Cause.TRIP: from_(BEGAN, {"contact": (True, True)}),
    Cause.SLIP: from_(BEGAN, SLIDE),
    Cause.FLIGHT: from_(BEGAN, {"contact": (False, False)}),
    Cause.STALL: from_(BEGAN, step={"dtheta": 0.0}),
    Cause.LATE: from_(BEGAN, step={"s": 1.2}),
    Cause.TORQUE: from_(BEGAN, {"torque": np.array([0.0, -LIMIT, 0.0, 0.0])}),
    Cause.SOLVER: from_(BEGAN, step={"fallback": True}),
    Cause.TRACKING: from_(BEGAN, step={"y": np.array([0.0, 0.0, -0.3, 0.0])}),
}


@pytest.mark.parametrize("cause", SYMPTOMS)
def test_each_symptom_is_found_when_it_begins(cause: Cause) -> None:
    found, evidence = verdict(SYMPTOMS[cause])
    assert found is cause
    assert BEGAN <= evidence.began_s <= BEGAN + 0.04
    assert evidence.lasted_s == pytest.approx(END - evidence.began_s, abs=2 * DT)


def test_the_figures_are_those_of_the_beginning() -> None:
    _, torque = verdict(SYMPTOMS[Cause.TORQUE])
    assert torque.joint == "right hip" and 0.5 < torque.torque_share < 1.0 and torque.flight_share == 0.0
    _, slip = verdict(SYMPTOMS[Cause.SLIP])
    assert slip.slip_m == pytest.approx(0.3 * 0.06, rel=0.2)  # of the 80 ms looked at, 60 after it began
    _, stall = verdict(SYMPTOMS[Cause.STALL])
    assert stall.clock_min_rad_s == 0.0 and stall.clock_max_rad_s == 1.0


@pytest.mark.parametrize("first", SYMPTOMS)
def test_the_first_symptom_wins_over_a_later_one(first: Cause) -> None:
    later = Cause.STALL if first is not Cause.STALL else Cause.TRACKING
    shift = {Cause.STALL: from_(BEGAN + 0.1, step={"dtheta": 0.0}), Cause.TRACKING: SYMPTOMS[Cause.TRACKING]}
    if first is Cause.STALL:
        shift[Cause.TRACKING] = from_(BEGAN + 0.1, step={"y": np.full(4, 0.3)})
    assert verdict(SYMPTOMS[first], shift[later])[0] is first


def test_a_symptom_that_passes_is_forgotten() -> None:
    early = from_(0.2, {"torque": np.full(4, LIMIT)}, until=0.4)
    assert verdict(early, SYMPTOMS[Cause.STALL])[0] is Cause.STALL
    assert verdict(early)[0] is Cause.UNCLEAR
    twice = from_(0.72, {"torque": np.full(4, LIMIT)}, until=0.78)  # ends within the gap before the stall
    assert verdict(twice, SYMPTOMS[Cause.STALL])[0] is Cause.TORQUE


def test_a_landing_foreseen_that_does_not_come_is_late() -> None:
    """The controller says 10 ticks ahead, again and again; the clock has not run out."""
    waits = from_(0.9, step={"impact_in": 10, "s": 0.95})
    found, evidence = verdict(waits)
    assert found is Cause.LATE and evidence.late_s > 0.01
    on_time = from_(0.99, step={"impact_in": 10})
    assert verdict(on_time)[0] is Cause.UNCLEAR


def test_a_foot_in_the_ground_explains_a_fall_at_once_and_no_later_one() -> None:
    sunk = from_(0.0, {"clearance": np.array([0.0, -0.005])}, until=DT / 2)
    at_once = from_(0.0, {"contact": (False, False)})
    found, evidence = verdict(sunk, at_once, end=0.3)
    assert found is Cause.START and evidence.sunk_m == pytest.approx(0.005)
    assert verdict(sunk, SYMPTOMS[Cause.STALL])[0] is Cause.STALL


def test_a_walker_that_stands_and_creeps_on_has_stalled() -> None:
    """The clock stood still for a moment long before the run ended for want of a step."""
    paused = from_(0.7, step={"dtheta": 0.05}, until=0.9)
    found, evidence = verdict(paused, end=2.6)
    assert found is Cause.STALL and evidence.clock_min_rad_s == pytest.approx(0.05)


class Asking(Witness):
    """Asks for a verdict every 50 ticks, as if the run had ended there."""

    def __init__(self, period, limits):
        super().__init__(period)
        self.limits, self.seen = limits, set()

    def ticks(self, ticks):
        for row in range(len(ticks)):
            super().ticks(ticks.part(row, row + 1, ticks.first + row))
            if (ticks.first + row) % 50 == 0:
                self.seen.add(self.verdict(self.limits)[0])


@pytest.mark.parametrize("kind", spec_at(Scenario(), "controller.kind").choices)
def test_an_undisturbed_walk_shows_no_symptom(kind: str) -> None:
    scenario = with_values(load("undisturbed"), {"controller.kind": kind, "steps": 2})
    witness = Asking(scenario.controller.period, build_plant(scenario).torque_limits)
    summary = run_scenario(scenario, tape=witness, belief=known_belief(scenario.walker, scenario.gait))
    assert summary.outcome == "completed"
    assert witness.seen == {Cause.UNCLEAR}


@pytest.mark.parametrize(
    ("changes", "cause"),
    [
        ({"pushes.0.force": -25.0, "pushes.0.step": 1}, Cause.STALL),
        ({"plant.ground.friction": 0.03}, Cause.SLIP),
        ({"start.q_offset": (0.0, 0.05, 0.0, 0.0, 0.0)}, Cause.START),
        ({"plant.torque_limit_factor.left_hip": 0.2, "plant.torque_limit_factor.right_hip": 0.2}, Cause.TORQUE),
    ],
)
def test_falls_whose_cause_is_plain_are_explained(changes: dict, cause: Cause) -> None:
    scenario = with_values(load("undisturbed"), {"controller.kind": "zd-pd", "steps": 5} | changes)
    witness = Witness(scenario.controller.period)
    summary = run_scenario(scenario, tape=witness, belief=known_belief(scenario.walker, scenario.gait))
    assert summary.outcome == "fell"
    assert witness.verdict(np.array(list(summary.torque_limit_Nm.values())))[0] is cause


def test_evidence_reads_back_and_speaks_for_every_cause() -> None:
    _, evidence = verdict(SYMPTOMS[Cause.TORQUE])
    known = json.loads(evidence.to_json())
    assert known.keys() == {field.name for field in dataclasses.fields(evidence)}
    assert set(PROOFS) == set(Cause) and set(SHARES) == set(SYMPTOMS)
    for cause in Cause:
        assert bool(decisive(cause.value, known)) == (cause is not Cause.UNCLEAR)
    assert "right hip" in decisive(Cause.TORQUE.value, known)


def test_a_run_without_ticks_has_no_clear_cause() -> None:
    cause, evidence = Witness(DT).verdict(np.full(4, LIMIT))
    assert cause is Cause.UNCLEAR and json.loads(evidence.to_json())["torque_share"] is None
