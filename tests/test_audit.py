"""Energy adds up on every shipped scenario and both plants; what the ground does is measured."""

import pytest

from sim import cli
from sim.bridge.audit import Balance, audited, rows
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


def test_an_integrator_with_inner_steps_is_refused() -> None:
    with pytest.raises(UserError, match="RK4"):
        audited(with_values(load("undisturbed"), {"plant.integrator": "RK4"}))


def test_the_command_prints_a_table(capsys) -> None:
    assert cli.main(["run", "undisturbed", "--controller", "zd-pd", "--steps", "1", "--audit"]) == 0
    assert "does not add up" in capsys.readouterr().out
