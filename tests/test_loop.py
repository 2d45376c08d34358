"""The loop holds what was decided on what was seen, pushes by the plant's steps, and ends for one reason."""

import numpy as np
import pytest
from fakes import COM, PERIOD, Clockwork, Counting, Tape

from sim.loop import Course, FallReason, Loop
from sim.loop.loop import PROGRESS_TICKS
from sim.scenario import Push


class Run:
    """A loop of stand-ins with everything it left behind."""

    def __init__(self, *, plant=None, controller=None, pushes=(), steps=3, end_time=10.0, **how):
        self.plant, self.controller, self.tape = plant or Clockwork(), controller or Counting(), Tape()
        self.loop = Loop(
            plant=self.plant,
            controller=self.controller,
            course=Course(q=np.zeros(5), dq=np.zeros(5), pushes=pushes, steps=steps, end_time=end_time),
            tape=self.tape,
        )
        self.summary = self.loop.run(**how)


def test_each_decision_is_held_once_on_what_was_just_seen():
    run = Run(steps=3)
    assert [u[0] for u in run.plant.torques] == list(range(30))
    assert [o.t for o in run.controller.seen] == pytest.approx([k * PERIOD for k in range(30)])
    assert [k for k, *_ in run.tape.told] == list(range(30))
    for _, state, observation, step, tick_s in run.tape.told:
        assert state.t == observation.t
        assert tick_s >= 0.0
        assert step.u_total[0] == pytest.approx(state.t / PERIOD)


def test_it_ends_after_the_steps_asked_for():
    run = Run(steps=3)
    assert (run.summary.outcome, run.summary.steps, run.summary.time_s) == ("completed", 3, 0.03)
    assert run.summary.step_time_s == pytest.approx(0.01) and run.summary.step_length_m == pytest.approx(0.4)
    assert [event[0] for event in run.tape.named("impact")] == [10, 20, 30]
    assert run.tape.events[-1][:3] == (30, "info", "completed")


def test_a_push_by_step_acts_throughout_that_step_of_the_plant():
    run = Run(pushes=(Push(force=25.0, step=2),), steps=4)
    pushed = [k for k, forces in enumerate(run.plant.forces) if forces]
    assert pushed == list(range(10, 20))
    (force,) = run.plant.forces[10]
    assert (force.body, force.point) == ("torso", COM["torso"])
    assert force.force == pytest.approx((25.0, 0.0))
    assert [(k, message) for k, _, _, message in run.tape.named("push")] == [(10, "push begins"), (20, "push ends")]


def test_a_push_by_time_acts_in_its_window_and_pushes_add_up():
    pushes = (Push(force=10.0, start=0.005, end=0.012, body="left_femur"), Push(force=25.0, step=1))
    run = Run(pushes=pushes, steps=2)
    assert [len(forces) for forces in run.plant.forces] == [1] * 5 + [2] * 5 + [1] * 2 + [0] * 8


def test_step_numbers_are_the_plants_whatever_the_controller_believes():
    run = Run(controller=Counting(lambda k: {"stance": "right"}), pushes=(Push(force=1.0, step=2),), steps=3)
    assert [k for k, forces in enumerate(run.plant.forces) if forces] == list(range(10, 20))
    assert run.summary.steps == 3


def test_a_fall_ends_the_run_with_its_reason():
    run = Run(plant=Clockwork(falls_at=15))
    assert run.summary.outcome == "fell" and run.summary.steps == 1
    assert run.summary.fall_reason.startswith(FallReason.HIP_LOW.value)
    assert len(run.plant.torques) == 15
    assert run.tape.events[-1][:3] == (15, "warning", "fell")
    assert run.summary.time_s == pytest.approx(0.015)


def test_a_diverged_plant_is_a_fall_not_an_exception():
    run = Run(plant=Clockwork(diverges_at=7))
    assert run.summary.outcome == "fell"
    assert FallReason.DIVERGED.value in run.summary.fall_reason and "qpos[3]" in run.summary.fall_reason
    assert len(run.tape.told) == 8  # the tick whose torque it was is in the log


def test_the_time_limit_ends_a_walker_that_stands_about():
    run = Run(plant=Clockwork(never_lands=True), end_time=0.05)
    assert run.summary.outcome == "fell"
    assert FallReason.STALLED.value in run.summary.fall_reason and "0.05 s" in run.summary.fall_reason
    assert run.summary.time_s == pytest.approx(0.05) and run.summary.step_time_s is None


def test_an_interruption_ends_it_at_the_next_tick_and_says_so():
    asked = []

    def stop():
        asked.append(None)
        return "interrupted by SIGINT" if len(asked) > 12 else None

    run = Run(stop=stop)
    assert (run.summary.outcome, run.summary.message) == ("interrupted", "interrupted by SIGINT")
    assert len(run.plant.torques) == 12 and run.summary.steps == 1
    assert run.tape.events[-1][:3] == (12, "warning", "interrupted")


def test_a_bug_in_the_controller_raises():
    def broken(k):
        if k == 5:
            raise ZeroDivisionError("a bug")
        return {}

    with pytest.raises(ZeroDivisionError):
        Run(controller=Counting(broken))


def test_fall_backs_are_counted_and_told_once_in_a_row():
    run = Run(controller=Counting(lambda k: {"fallback": k in (3, 4, 5, 9), "status": "no-solution"}), steps=2)
    assert run.summary.fallbacks == 4
    assert [(k, level) for k, level, *_ in run.tape.named("fallback")] == [(3, "warning"), (9, "warning")]
    assert "no-solution" in run.tape.named("fallback")[0][3]


def test_progress_is_told_now_and_then():
    told = []
    run = Run(plant=Clockwork(100), steps=2, progress=lambda steps, t: told.append((steps, t)))
    assert len(told) == 200 // PROGRESS_TICKS
    assert [t for _, t in told] == pytest.approx([0.05, 0.1, 0.15, 0.2], abs=1.5 * PERIOD)
    assert run.summary.steps == 2


def test_two_runs_of_the_same_are_the_same():
    a, b = Run(pushes=(Push(force=25.0, step=2),)), Run(pushes=(Push(force=25.0, step=2),))
    assert a.tape.events == b.tape.events
    assert np.array_equal(a.plant.torques, b.plant.torques)
