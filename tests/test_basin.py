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


def test_a_map_is_told_by_the_points_along_its_boundaries() -> None:
    rows, columns = np.mgrid[0:31, 0:25]
    ellipse = (((rows - 14.3) / 9.2) ** 2 + ((columns - 11.6) / 7.1) ** 2 < 1.0).astype(int)
    tongue = ellipse | ((np.abs(rows - columns) < 2) & (columns < 20))  # thinner than a cell, and not in the first look
    for whole, most in ((ellipse, 0.45), (tongue, 0.7), (np.ones_like(ellipse), 0.15), (rows % 3, 1.0)):
        asked: list[tuple[int, int]] = []

        def at(row: int, column: int, whole=whole, asked=asked) -> int:
            asked.append((row, column))
            return int(whole[row, column])

        found = basin.filled(whole.shape, at)
        assert (found == whole).all()
        assert len(asked) == len(set(asked)) <= most * whole.size


def test_a_followed_map_is_that_of_its_columns() -> None:
    offsets, forces = [-0.1, 0.1], [0.0, 200.0]
    found = basin.followed(RIGID, "torso", offsets, forces, 0.05, 5)
    for i, offset in enumerate(offsets):
        column = basin.column(RIGID, "torso", offset, forces, 0.05, 5)
        for what, values in column.items():
            assert found[what][:, i].tolist() == values.tolist()
    assert found["run"].all() and not found["trips"][0].any()


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


def test_the_map_is_of_the_controller_that_is_named(tmp_path, capsys) -> None:
    words = ["--plant.kind", "rigid", "--plant.timestep", "0.001", "--torso", "-0.02", "0.02", "2", "--quiet"]
    words += ["--force", "0", "2", "2", "--limit", "4", "--workers", "1", "--out", str(tmp_path)]
    assert cli.main(["basin", "undisturbed", *words, "--controller", "c-mpc-ltv", "--epsilon", "0.3"]) == 0
    areas = json.loads((tmp_path / "basin.json").read_text())["area [rad N]"]
    assert [*areas] == ["zd-pd", "c-mpc-ltv"]
    assert "c-mpc-ltv's is 1.00 times ZD+PD's" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--torso", "0.2", "-0.2", "5"], "--torso"),
        (["--force", "0", "10", "1"], "--force"),
        (["--torso", "-1", "1", "inf"], "--torso"),
        (["--torso", "-1", "nan", "5"], "--torso"),
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
    from sim.reproduce.study import Effort

    quick = Effort(quick=True)
    results = {}
    for name, task in fig8.tasks(quick).items():
        shape = len(task.arguments["force"]), len(task.arguments["torso"])
        fate = np.full(shape, int(basin.Fate.UNDECIDED if "c-mpc" in name else basin.Fate.FELL))
        fate[0, 0] = basin.Fate.CONVERGED
        off = np.zeros(shape, dtype=bool)
        results[name] = {"fate": fate, "steps": 0 * fate, "scuff": 0.0 * fate, "trips": off, "run": ~off}
    found = fig8.evaluate(results, quick)
    assert "8.00 against 8.00 rad N: 1.00 times" in found.verdicts[0].rigid.text  # a cell of 0.267 rad and 30 N
