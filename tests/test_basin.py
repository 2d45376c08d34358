"""Basin of attraction: fates, periodic state, command."""

import csv
import json

import numpy as np
import pytest

from sim import cli
from sim.errors import UserError
from sim.reproduce import basin
from sim.scenario import Scenario, to_toml, with_values

RIGID = to_toml(with_values(Scenario(), {"plant.kind": "rigid", "plant.timestep": 1e-3, "controller.kind": "zd-pd"}))


def test_undisturbed_comes_back_and_a_blow_fells() -> None:
    found = basin.column(RIGID, "torso", 0.0, [0.0, 10.0, 200.0], 0.05, 20)
    assert found["fate"].tolist() == [basin.Fate.CONVERGED, basin.Fate.CONVERGED, basin.Fate.FELL]
    assert found["steps"][0] == 1


def test_too_few_steps_decide_nothing() -> None:
    found = basin.column(RIGID, "torso", 0.0, [25.0], 1e-6, 2)
    assert found["fate"].tolist() == [basin.Fate.UNDECIDED]


def test_the_two_readings_of_the_offset_differ() -> None:
    tilted = {axis: basin.column(RIGID, axis, -0.3, [10.0], 0.05, 12)["fate"][0] for axis in basin.AXES}
    assert tilted["torso"] == basin.Fate.CONVERGED
    assert tilted["q5"] == basin.Fate.FELL


def test_a_walk_that_falls_undisturbed_has_no_basin() -> None:
    broken = to_toml(with_values(Scenario(), {"controller.kind": "zd-pd", "plant.mass_factor.torso": 2.0}))
    with pytest.raises(UserError, match=r"no basin: .*falls in step"):
        basin.column(broken, "torso", 0.0, [0.0], 0.05, 5)


def test_grid_and_cell() -> None:
    grid = basin.Grid.of((-0.2, 0.2, 5), (0.0, 30.0, 4))
    assert grid.torso == pytest.approx([-0.2, -0.1, 0.0, 0.1, 0.2])
    assert grid.cell == pytest.approx(1.0)


def test_the_command_writes_map_and_data(tmp_path, capsys) -> None:
    words = ["--plant.kind", "rigid", "--plant.timestep", "0.001", "--torso", "-0.1", "0.1", "2"]
    words += ["--force", "0", "200", "2", "--limit", "4", "--workers", "1", "--out", str(tmp_path / "b")]
    assert cli.main(["basin", "undisturbed", *words]) == 0
    rows = list(csv.DictReader((tmp_path / "b" / "basin.csv").open()))
    assert len(rows) == 4
    fates = {(float(row["torso offset [rad]"]), float(row["force [N]"])): row for row in rows}
    assert fates[0.1, 200.0]["c-mpc fate"] == "0"
    areas = json.loads((tmp_path / "b" / "basin.json").read_text())["area [rad N]"]
    inside = sum(row["zd-pd fate"] == "1" for row in rows)
    assert areas["zd-pd"] == pytest.approx(inside * 0.2 * 200.0)
    assert (tmp_path / "b" / "basin.png").read_bytes().startswith(b"\x89PNG")
    before = (tmp_path / "b" / "basin.csv").read_bytes()
    assert cli.main(["basin", "undisturbed", *words]) == 0  # from stored results
    assert (tmp_path / "b" / "basin.csv").read_bytes() == before


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--torso", "0.2", "-0.2", "5"], "--torso"),
        (["--force", "0", "10", "1"], "--force"),
        (["--force", "0", "10", "2.5"], "--force"),
        (["--epsilon", "0"], "--epsilon"),
        (["--limit", "0"], "--limit"),
        (["--axis", "hip"], "--axis"),
    ],
)
def test_bad_input_is_named(capsys, tmp_path, words: list[str], message: str) -> None:
    assert cli.main(["basin", "--out", str(tmp_path), *words]) == 2
    assert message in capsys.readouterr().err


def test_areas_count_converged_points_only() -> None:
    from sim.reproduce.experiments import fig8

    grid = basin.Grid.of((0.0, 1.0, 2), (0.0, 10.0, 2))
    fates = {"a/zd-pd/0": [1, 2], "a/zd-pd/1": [0, 1]}
    results = {name: {"fate": np.array(fate)} for name, fate in fates.items()}
    assert fig8.converged(results, "a", "zd-pd", grid).tolist() == [[True, False], [False, True]]
