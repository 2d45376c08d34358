"""Energy adds up on every shipped scenario and both plants; what the ground does is measured."""

import numpy as np
import pytest
from fakes import control_step, plant_state, tell

from sim import cli
from sim.bridge.audit import Balance, audited, rows
from sim.bridge.run import run_scenario
from sim.bridge.steadiness import Steady
from sim.errors import UserError
from sim.scenario import load, shipped, with_values

SHARE = 1e-3  # of the motors' work that may be missing


@pytest.mark.parametrize("plant", ["mujoco", "rigid"])
@pytest.mark.parametrize("name", shipped())
def test_energy_adds_up(name: str, plant: str) -> None:
    changes = {"plant.kind": plant, "steps": 3, "controller.kind": "zd-pd" if name == "undisturbed" else "c-mpc"}
    summary, found = audited(with_values(load(name), changes))
    assert summary.outcome == "completed"
    energy = found.energy
    assert energy.motors > 20.0 and energy.damping < 0.0 and energy.contact < 0.0
    assert (energy.pushes != 0.0) == ("push" in name or "friction" in name)
    assert abs(energy.residual) <= SHARE * energy.motors_moved


def test_missing_work_shows() -> None:
    assert Balance(motors=10.0, motors_moved=12.0, damping=-4.0, change=7.0).residual == pytest.approx(1.0)


def test_an_impact_on_mujoco_is_near_the_rigid_one_and_the_foot_stays_on_the_ground() -> None:
    _, found = audited(with_values(load("undisturbed"), {"controller.kind": "zd-pd", "steps": 4}))
    assert found.impulse_error is not None and abs(found.impulse_error) < 0.15
    assert found.flight_share == 0.0
    assert 0.0 < found.penetration < 1e-4 < found.penetration_impact < 1e-3  # [m]
    assert dict(rows(found, 0.001))["slip of the stance foot"] == "1.00 mm in all"


def test_the_stance_force_is_told_apart_from_one_that_alternates() -> None:
    steady = Steady(2)
    for k in range(40):
        if k == 20:
            steady.event(k, "info", "impact", "right foot")
        force = np.zeros((2, 2))
        force[int(k >= 20), 1] = 300.0 + k + 0.25 * (-1) ** k + (500.0 if k in (20, 21) else 0.0)  # an impact's
        torque = np.full(4, 90.0 if k == 1 else 55.0 if k == 21 else 40.0 if k < 24 else 60.0)
        tell(steady, k, plant_state(t=1e-3 * k, contact_force=force, torque=torque), None, control_step(), 0.0)
    found = steady.found()
    assert found.alternation == pytest.approx(1.0) and found.alternation_rms == pytest.approx(1.0)
    assert found.landing_torque == 55.0  # that of the start does not count


def test_the_ground_carries_a_pushed_walker_steadily_and_landings_ask_for_little() -> None:
    def steadiness(name: str, changes: dict):
        tape = Steady(20)
        summary = run_scenario(with_values(load(name), changes), tape=tape)
        return summary, tape.found()

    push = {"pushes.0.force": 20.0, "pushes.0.step": 1, "steps": 4, "controller.kind": "zd-pd"}
    assert steadiness("push-25N", push)[1].alternation <= 1.0  # [N]; 15 with solimp from 0.95
    summary, mpc = steadiness("undisturbed", {"gait": "paper-polished", "steps": 4})
    assert mpc.landing_torque <= 60.0  # [N.m]
    assert summary.mpc_torque_share <= 0.02


def test_an_integrator_with_inner_steps_is_refused() -> None:
    with pytest.raises(UserError, match="RK4"):
        audited(with_values(load("undisturbed"), {"plant.integrator": "RK4"}))


@pytest.mark.parametrize("other", [["--log", "x.mcap"], ["--viewer"]])
def test_an_audit_writes_no_log_and_shows_no_window(capsys, other: list[str]) -> None:
    assert cli.main(["run", "undisturbed", "--audit", *other]) == 2
    assert f"--audit and {other[0]}: must be one of them" in capsys.readouterr().err


def test_an_audit_heeds_the_time_limit() -> None:
    summary, _ = audited(with_values(load("undisturbed"), {"controller.kind": "zd-pd", "time_limit": 0.01}))
    assert summary.outcome == "fell" and "time limit" in summary.fall_reason


def test_the_command_prints_a_table(capsys) -> None:
    assert cli.main(["run", "undisturbed", "--controller", "zd-pd", "--steps", "1", "--audit"]) == 0
    shown = capsys.readouterr().out
    assert "does not add up" in shown and "nan" not in shown
