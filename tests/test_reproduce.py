"""Reproduction: verdicts are computed, broken controllers fail them, results are kept and reproducible."""

import dataclasses
import importlib
import importlib.util
import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from controller.cmpc import CascadedMpc
from controller.common.records import observation_of, write_step
from sim import cli
from sim.errors import UserError
from sim.reproduce import (
    EXPERIMENTS,
    criteria,
    measure,
    report,
)
from sim.reproduce.experiments import (
    fig3,
    fig4,
    fig5,
    fig6,
    fig7,
    fig8,
    incline,
    noise,
    readings,
    table2,
)
from sim.reproduce.panels import LinePanel, Series, thinned
from sim.reproduce.study import PLANTS, Effort, Evaluation, Finding, Verdict, evaluation_of, tasks_of
from sim.runner import Stopped, Task, TaskStore, run_tasks
from sim.runner.tasks import work


def run(module, effort: Effort) -> Evaluation:
    """An experiment, run here and now."""
    measure._rig.cache_clear()
    results = {name: work(task) for name, task in module.tasks(effort).items()}
    measure._rig.cache_clear()
    return module.evaluate(results, effort)


def holds(found: Evaluation, plant: str) -> list[bool | None]:
    return [getattr(verdict, plant).holds for verdict in found.verdicts]


# The claims, and controllers that must fail them


def test_with_the_controllers_of_the_paper_the_gait_is_the_paper_s() -> None:
    found = run(fig3, Effort())
    for plant in PLANTS:
        assert all(holds(found, plant))


def test_without_gains_the_claims_fail_on_both_plants() -> None:
    broken = Effort(changes={"controller.kp": (0.0, 0.0, 0.0, 0.0), "controller.kd": (0.0, 0.0, 0.0, 0.0)})
    found = run(fig3, broken)
    for plant in PLANTS:
        assert not any(holds(found, plant))


def test_with_the_mpc_negated_the_claims_fail_on_both_plants(monkeypatch) -> None:
    step = CascadedMpc.step

    def negated(self, observation):
        good = step(self, observation)
        return dataclasses.replace(good, u_mpc=-good.u_mpc, u_total=good.u_zd - good.u_mpc)

    def decide(self, seen, step, i):
        write_step(step, i, self.step(observation_of(seen[i])))

    monkeypatch.setattr(CascadedMpc, "step", negated)
    monkeypatch.setattr(CascadedMpc, "decide", decide)
    monkeypatch.setattr(CascadedMpc, "bound", lambda *_: None)
    found = run(fig5, Effort())
    for plant in PLANTS:
        both_walk, peak, rms, remaining = holds(found, plant)
        assert not (both_walk or peak or rms or remaining)


# Evaluation alone, of results made up here


def made_up_walk(**changes) -> dict:
    n = 1200
    run = {
        "t": np.arange(n) * 1e-3,
        "landed": np.array([300, 600, 900]),
        "force": np.column_stack((np.full(n, 50.0), np.full(n, 100.0))),
        "u": np.full((n, 4), 40.0),
        "torque": np.full((n, 4), 40.0),
        "slack": np.zeros(n),
        "outcome": np.array(0),
        "steps": np.array(10),
        "torque_limit": np.array([75.0, 75.0, 50.0, 50.0]),
    }
    return run | changes


def margins(zd: float, mpc: float) -> dict:
    return {
        f"{plant}/{controller}/margin/{step}": {
            "value": np.array(value),
            "tripping": np.array(value),
            "tried": np.array([value]),
            "survived": np.array([True]),
            "scuff": np.array([0.0]),
        }
        for plant in PLANTS
        for controller, value in (("zd-pd", zd), ("c-mpc", mpc))
        for step in (1, 2)
    }


def fig4_results(**cmpc) -> dict:
    unsaturated = made_up_walk(torque=np.full((1200, 4), 120.0), u=np.full((1200, 4), 120.0))
    fallen = made_up_walk(outcome=np.array(1), steps=np.array(3))
    return margins(25.0, 60.0) | {
        f"{plant}/{name}": value
        for plant in PLANTS
        for name, value in (
            ("zd-pd, unsaturated", unsaturated),
            ("zd-pd, saturated", fallen),
            ("c-mpc", made_up_walk(**cmpc)),
        )
    }


def test_fig4_follows_its_data() -> None:
    assert all(holds(fig4.evaluate(fig4_results(), Effort()), "rigid"))
    over = fig4.evaluate(fig4_results(u=np.full((1200, 4), 60.0)), Effort())
    assert holds(over, "rigid")[0] is False  # 60 N.m is beyond a knee
    fallen = fig4.evaluate(fig4_results(outcome=np.array(1)), Effort())
    assert holds(fallen, "rigid")[0] is False
    weak = fig4.evaluate(fig4_results() | margins(30.0, 20.0), Effort())
    assert holds(weak, "mujoco")[4:] == [False] * 6


def test_fig4_says_from_which_force_on_a_survivor_walks_through_the_ground() -> None:
    results = fig4_results()
    results["rigid/zd-pd/margin/1"] = {
        "value": np.array(35.0),
        "tripping": np.array(24.0),
        "tried": np.array([20.0, 24.0, 35.0, 40.0]),
        "survived": np.array([True, True, True, False]),
        "scuff": np.array([0.0, 1e-3, 22e-3, 50e-3]),
    }
    found = fig4.evaluate(results, Effort()).verdicts
    assert found[4].rigid == Finding(text="35 N, the swing foot in the ground from 24 N on, up to 22.0 mm", holds=False)
    assert found[5].rigid == Finding(text="24 N", holds=True)


def test_fig6_compares_the_windows_of_one_run() -> None:
    def results(before: float, after: float, alone: float) -> dict:
        def walked(*rms: float) -> dict:
            u_mpc = np.repeat(rms, 100)[:, None] * np.ones(4)
            n = len(u_mpc)
            landed = np.arange(100, n + 1, 100)
            for k in landed[landed < n]:
                u_mpc[k : k + 5] = 500.0  # an impact's, which do not count
            return {"t": np.arange(n) * 1e-3, "landed": landed, "u_mpc": u_mpc, "u_zd": np.full((n, 4), 20.0)}

        pushed = walked(before, 10.0, *[5.0] * 6, *[after] * 4)
        return {
            f"{plant}/{n}": r
            for plant in PLANTS
            for n, r in (("pushed", pushed), ("undisturbed", walked(*[alone] * 15)))
        }

    assert holds(fig6.evaluate(results(0.9, 0.9, 1.9), Effort()), "rigid") == [True, True, True]
    assert holds(fig6.evaluate(results(1.1, 1.1, 2.1), Effort()), "mujoco") == [False, False, False]


@pytest.mark.parametrize(
    "rule", [criteria.negligible, criteria.never_above, criteria.above, criteria.no_worse, criteria.no_larger]
)
def test_nothing_holds_of_a_value_that_is_not_there(rule) -> None:
    assert rule(float("nan"), 1.0) is False
    assert criteria.measured(float("nan"), 1.0) is False


def test_every_experiment_is_judged_by_a_rule() -> None:
    assert set(EXPERIMENTS) == {name for rule in criteria.RULES for name in rule.used.split(", ")}


def test_fig7_is_about_the_worst_ratio_away_from_impacts() -> None:
    def results(ratio: float, spike_at: int) -> dict:
        force = np.column_stack((np.full(1200, 100.0 * ratio), np.full(1200, 100.0)))
        force[spike_at, 0] = 500.0
        without = np.column_stack((np.full(1200, 90.0), np.full(1200, 100.0)))
        return {
            f"{plant}/{name}": made_up_walk(force=f, force_now=0.9 * f)
            for plant in PLANTS
            for name, f in (("with/0.6", force), ("without", without))
        }

    quick = Effort(quick=True)
    assert holds(fig7.evaluate(results(0.59, 305), quick), "rigid") == [True] * 3  # an impact's force
    over = fig7.evaluate(results(0.59, 450), quick)
    assert holds(over, "rigid") == [False, False, True]
    assert any("1 ticks above mu, the rows softened in 0" in note for note in over.notes)
    assert holds(fig7.evaluate(results(0.7, 305), quick), "rigid") == [False, False, True]


def test_table2_wants_the_paper_s_values_on_its_plant_and_its_verdicts_on_the_other() -> None:
    def results(nominal: float, doubled: float, fell: int, noise: float = 1e-2) -> dict:
        found = {}
        for plant in PLANTS:
            for controller, case in table2._cases():
                value = nominal if case == "nominal" else doubled
                entry = {
                    "fell_in_step": np.array(0),
                    "residual": np.array(1e-9),
                    "scatter": np.array(1e-3),
                    "largest": np.array(value),
                    "eigenvalues": np.full(9, value),
                    "h": np.array(1e-2),
                    "noise": np.array(noise),
                    "roughness": np.array(1e-4),
                    "study_h": np.array([1e-2]),
                    "study_largest": np.array([value]),
                    "study_jumps": np.array([0.1]),
                }
                if controller == "zd-pd" and case != "nominal":
                    entry = {"fell_in_step": np.array(fell), "residual": np.array(1.0)}
                found[f"{plant}/{controller}/{case}"] = entry
        return found

    assert holds(table2.evaluate(results(0.745, 0.8, 2), Effort()), "rigid") == [True] * 7
    assert holds(table2.evaluate(results(0.6, 0.8, 0), Effort()), "rigid") == [False] * 4 + [True, False, True]
    assert holds(table2.evaluate(results(0.6, 0.8, 2), Effort()), "mujoco") == [True] * 7
    assert holds(table2.evaluate(results(1.1, 1.2, 2), Effort()), "mujoco") == [
        False,
        False,
        True,
        True,
        False,
        True,
        False,
    ]
    noisy = table2.evaluate(results(0.75, 0.8, 2, noise=0.05), Effort())
    assert holds(noisy, "rigid") == [
        False,
        False,
        True,
        True,
        True,
        True,
        True,
    ]  # 0.05 is more than 0.02, less than 0.1
    assert holds(table2.evaluate(results(0.75, 0.8, 2, noise=0.3), Effort()), "mujoco")[0] is False


def test_incline_says_when_a_foot_in_the_air_was_expected_to_land() -> None:
    def results(clearance: float, zd: float, mpc: float) -> dict:
        n = 1200
        late = np.where(np.arange(n) < 100, clearance, 0.0)  # [m]
        walked = made_up_walk(
            clearance=late,
            impact_in=np.ones(n, dtype=int),
            u_mpc=np.full((n, 4), 30.0),
            hip=np.column_stack((np.arange(n) * 0.8e-3, np.full(n, 0.7))),
        )
        slopes = {"zd-pd": zd, "c-mpc": mpc}
        return {
            name: walked
            if "/walk/" in name or name.endswith("/slow")
            else dict.fromkeys(("value", "tripping"), np.array(slopes[name.split("/")[1]]))
            for name in incline.tasks(Effort())
        }

    found = incline.evaluate(results(0.01, 0.04, 0.02), Effort())
    assert holds(found, "rigid") == [True, True, False, False, True]
    assert any("in 100 ticks its prediction lands" in note and "0.80 m/s" in note for note in found.notes)
    found = incline.evaluate(results(0.0, 0.01, 0.015), Effort())
    assert holds(found, "mujoco") == [False, False, True, True, True]
    assert not any("touch-down is late" in note for note in found.notes)


def test_fig8_compares_areas_and_upper_boundaries() -> None:
    quick = Effort(quick=True)

    def results(zd_top: int, mpc_top: int, last: int | None = None) -> dict:
        found = {}
        for name, task in fig8.tasks(quick).items():
            fate = np.zeros((len(task.arguments["force"]), len(task.arguments["torso"])), dtype=int)
            fate[2 : zd_top if "zd-pd" in name else mpc_top] = 1
            if last is not None and "c-mpc" in name:
                fate[last:, -1] = 0
            trips = np.full(fate.shape, "zd-pd" in name)
            found[name] = {"fate": fate, "steps": 0 * fate, "scuff": 2e-3 * trips, "trips": trips, "run": ~trips}
        return found

    assert holds(fig8.evaluate(results(4, 6), quick), "rigid") == [True, True, True, True, True, None]
    assert holds(fig8.evaluate(results(5, 5), quick), "rigid") == [False, False, True, False, False, None]
    assert holds(fig8.evaluate(results(4, 6, last=3), quick), "rigid") == [True, True, True, False, False, None]
    assert holds(fig8.evaluate(results(4, 6), quick), "mujoco") == [
        True,
        None,
        True,
        True,
        None,
        None,
    ]  # no foot underground


def test_both_gaits_are_judged_side_by_side_unless_one_is_asked_for() -> None:
    asked = tasks_of(fig6, Effort())
    assert {name.partition("/")[0] for name in asked} == {"paper", "paper-polished"}
    assert 'gait = "paper-polished"' in asked["paper-polished/rigid/pushed"].arguments["scenario"]
    assert {name.partition("/")[0] for name in tasks_of(fig6, Effort(changes={"gait": "paper"}))} == {"paper"}
    assert all(
        {
            name.partition("/")[0]
            for name in tasks_of(importlib.import_module(f"sim.reproduce.experiments.{n}"), Effort())
        }
        == {"paper", "paper-polished"}
        for n in EXPERIMENTS
    )


def test_a_claim_s_verdicts_with_both_gaits_stand_beside_each_other() -> None:
    def evaluate(results, effort: Effort) -> Evaluation:
        finding = Finding(text=effort.changes.get("gait", "paper"), holds="x" in results)
        verdict = Verdict(claim="x", paper="-", rigid=finding, mujoco=finding)
        return Evaluation(verdicts=(verdict,), panels=(), tables={"t": {}}, notes=("same",))

    found = evaluation_of(SimpleNamespace(evaluate=evaluate), {"paper/x": {}, "paper-polished/y": {}}, Effort())
    (verdict,) = found.verdicts
    assert (verdict.rigid.text, verdict.rigid.holds) == ("paper", True)
    assert [(other.text, other.holds) for other in verdict.polished] == [("paper-polished", False)] * 2
    assert set(found.tables) == {"t", "polished-t"} and found.notes == ("same",)


def test_readings_follow_their_data() -> None:
    def run(*walked: bool) -> dict:
        return {"walked": np.array(walked), "steps": np.full(3, 2), "scuff": np.zeros(3)}

    results = {
        name: run(True, True, False) if "zd-pd" in name else run(True, True, True) for name in readings.tasks(Effort())
    }
    found = readings.evaluate(results, Effort())
    assert holds(found, "rigid") == [True] * len(readings.READINGS)
    assert "ZD+PD 25 walks, 30 walks, 40 falls in step 3" in found.verdicts[0].rigid.text
    assert [len(row) for row in found.panels] == [2, 2]  # a plant a row, a controller a column
    results["mujoco/zd-pd/at the hip"] = run(True, True, True)
    assert holds(readings.evaluate(results, Effort()), "mujoco").count(False) == 1


def test_noise_is_judged_by_what_is_survived_and_by_tracking_under_the_same() -> None:
    def results(mpc: float, zd: float) -> dict:
        level = {"zd-pd": zd, "c-mpc": mpc}
        found = {}
        for name in noise.tasks(Effort()):
            found[name] = {
                "value": np.array(1.0),
                "tried": np.array([1.0]),
                "survived": np.array([20]),
                "scuff": np.array(0.0),
                "rms": level[name.split("/")[1]] + 1e-5 * np.arange(20),
            }
        return found

    assert holds(noise.evaluate(results(0.002, 0.004), Effort()), "rigid")[3:] == [True] * 3
    assert holds(noise.evaluate(results(0.00399, 0.004), Effort()), "rigid")[3:] == [False] * 3


def test_the_search_for_a_force_brackets_it() -> None:
    scenario = Effort().scenario("rigid", "zd-pd", {"steps": 3, "pushes.0.force": 0.0, "pushes.0.step": 1})
    found = measure.largest_survived(scenario, "pushes.0.force", 1.0, 32.0, 4.0, 200.0)
    fate = dict(zip(found["tried"].tolist(), found["survived"].tolist(), strict=True))
    value = float(found["value"])
    assert value == max(force for force, survived in fate.items() if survived)
    assert fate[value + 4.0] is False


def test_noise_is_searched_from_the_rung_that_tracking_is_measured_on() -> None:
    scenario = Effort().scenario("rigid", "zd-pd", {"steps": 2})
    paths = list(noise.KINDS["encoder"][0])
    found = measure.noise(scenario, paths, [1e-4, 8e-4, 0.5], 8e-4, 2)
    assert found["tried"].tolist() == [8e-4, 0.5] and found["survived"].tolist() == [2, 0]
    assert found["value"] == 8e-4 and (found["rms"] > 1e-3).all()


def test_a_walk_that_falls_has_no_eigenvalue() -> None:
    scenario = Effort().scenario("rigid", "zd-pd", {"plant.mass_factor.torso": 2.0})
    found = measure.stability(scenario, [2e-2], 1)
    assert found["fell_in_step"] > 0 and "largest" not in found
    assert table2._words(found) == f"falls in step {found['fell_in_step']}"


# Keeping results


def counted(value: float, calls: str) -> dict:
    with open(calls, "a") as file:
        file.write("x")
    return {"x": np.array(value)}


@pytest.fixture
def store(tmp_path) -> TaskStore:
    return TaskStore(tmp_path / "tasks")


def few(store: TaskStore, *values: float) -> dict[str, Task]:
    calls = str(store.folder / "calls")
    return {f"{v:g}": Task(function=f"{__name__}:counted", arguments={"value": v, "calls": calls}) for v in values}


def calls(store: TaskStore) -> int:
    return len((store.folder / "calls").read_text())


def test_results_are_kept_and_damaged_ones_made_again(store) -> None:
    wanted = few(store, 1.0, 2.0)
    run_tasks(wanted, store, workers=1)
    run_tasks(wanted, store, workers=1)
    assert calls(store) == 2
    store._db.execute(
        "UPDATE results SET arrays = ? WHERE key = ?", (b"PK\x03\x04 half a file", store.key(wanted["1"]))
    )
    run_tasks(wanted, store, workers=1)
    assert calls(store) == 3
    assert store.get(wanted["1"])["x"] == 1.0


def test_a_task_that_reads_another_file_has_another_result(store, tmp_path) -> None:
    (tmp_path / "gait").write_text("a")
    task = dataclasses.replace(few(store, 1.0)["1"], files=(str(tmp_path / "gait"),))
    before = store.key(task)
    (tmp_path / "gait").write_text("b")
    assert store.key(task) != before != store.key(few(store, 1.0)["1"])


def test_an_interrupted_run_goes_on_where_it_stopped(store) -> None:
    def interrupt(name: str) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_tasks(few(store, 1.0, 2.0, 3.0), store, workers=1, finished=interrupt)
    finished: list[str] = []
    run_tasks(few(store, 1.0, 2.0, 3.0), store, workers=1, finished=finished.append)
    assert calls(store) in (3, 4)  # a worker may have begun the next
    assert sorted(finished) == ["1", "2", "3"]


@pytest.mark.parametrize("workers", [1, 2])
def test_a_request_to_stop_is_heeded_and_what_is_finished_is_kept(store, workers: int) -> None:
    steps = [Effort().scenario("rigid", "zd-pd", {"steps": n}) for n in (1, 2)]
    wanted = {
        str(i): Task(function="sim.reproduce.measure:walk", arguments={"scenario": s}) for i, s in enumerate(steps)
    }
    finished: list[str] = []
    with pytest.raises(Stopped, match="enough"):
        run_tasks(wanted, store, workers=workers, finished=finished.append, stop=lambda: "enough" if finished else None)
    assert finished and all(store.get(wanted[name]) is not None for name in finished)


def test_equal_tasks_are_run_once(store) -> None:
    task = few(store, 1.0)["1"]
    finished: list[str] = []
    run_tasks({"a": task, "b": task}, store, workers=1, finished=finished.append)
    assert calls(store) == 1
    assert finished == ["a", "b"]


def test_workers_bring_back_the_same_bytes(store) -> None:
    wanted = {
        name: Task(
            function="sim.reproduce.measure:walk",
            arguments={"scenario": Effort().scenario("rigid", "zd-pd", {"steps": 2, "start.torso_offset": offset})},
        )
        for name, offset in (("a", 0.0), ("b", 0.01))
    }
    shown: list[tuple[float, float]] = []
    run_tasks(wanted, store, workers=2, progress=lambda *now: shown.append(now))
    assert shown[-1] == (2.0, 2.0)
    for name, task in wanted.items():
        here, there = work(task), store.get(task)
        for key in here.keys() - {"tick_ms"}:
            assert here[key].tobytes() == there[key].tobytes(), (name, key)


def test_a_folder_that_cannot_be_written_is_named(tmp_path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(UserError, match=r"--out .*file"):
        TaskStore(tmp_path / "file" / "tasks")


# Writing


def finding() -> Evaluation:
    x = np.linspace(0, 1, 50)
    panel = LinePanel(title="t", x_label="x [s]", y_label="y [m]", series=(Series(name="a<b", x=x, y=x * np.nan),))
    verdict = Verdict(
        claim="1 < 2", paper="-", rigid=Finding(text="<&>", holds=True), mujoco=Finding(text="n", holds=False)
    )
    return Evaluation(verdicts=(verdict,), panels=((panel,),), tables={"a": {"x [s]": x}}, notes=("</script>",))


def test_files_are_complete_self_contained_and_reproducible(tmp_path) -> None:
    found = {}
    for folder in (tmp_path / "one", tmp_path / "two"):
        folder.mkdir()
        report.write("fig3", finding(), folder, quick=False)
        report.write_page({"fig3": finding()}, folder, quick=True)
        found[folder.name] = {f.relative_to(folder): f.read_bytes() for f in folder.rglob("*") if f.is_file()}
    assert found["one"] == found["two"]
    names = {str(name) for name in found["one"]}
    assert names == {"fig3.json", "fig3.png", "fig3.html", "index.html", "data/fig3-a.csv"}
    page = found["one"][Path("index.html")].decode()
    assert 'src="http' not in page and 'href="http' not in page and "@import" not in page
    assert "&lt;&amp;&gt;" in page and "Coarse" in page
    saved = json.loads(found["one"][Path("fig3.json")])
    assert saved["verdicts"][0]["mujoco"] == {"text": "n", "holds": False}
    assert found["one"][Path("data/fig3-a.csv")].decode().splitlines()[0] == "x [s]"


@pytest.mark.parametrize("name, other", [("data", Path.touch), ("fig3.png", Path.mkdir), ("fig3.json", Path.mkdir)])
def test_what_stands_in_the_way_of_a_file_is_named(name, other, tmp_path) -> None:
    other(tmp_path / name)
    with pytest.raises(UserError, match=f"{tmp_path / name}: cannot be (made|written): "):
        report.write("fig3", finding(), tmp_path, quick=False)


def test_a_page_says_what_was_changed_in_every_run(tmp_path) -> None:
    (tmp_path / "data").mkdir()
    changes = {"controller.kp": (0.0,) * 4}
    report.write("fig3", finding(), tmp_path, quick=False, changes=changes)
    page = report.write_page({"fig3": finding()}, tmp_path, quick=False, changes=changes)
    for path in (page, tmp_path / "fig3.html"):
        assert "against the paper:</b> controller.kp = (0.0, 0.0, 0.0, 0.0)" in path.read_text()
    assert json.loads((tmp_path / "fig3.json").read_text())["changed"] == {"controller.kp": "(0.0, 0.0, 0.0, 0.0)"}


def test_another_controller_takes_the_place_of_c_mpc_alone() -> None:
    changed = Effort(changes={"controller.kind": "c-mpc-ltv"})
    assert 'kind = "c-mpc-ltv"' in changed.scenario("rigid", "c-mpc")
    assert 'kind = "zd-pd"' in changed.scenario("rigid", "zd-pd")


def test_the_page_of_the_docs_is_filled_from_what_was_found(tmp_path) -> None:
    spec = importlib.util.spec_from_file_location("results", Path(__file__).parents[1] / "docs" / "results.py")
    results = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(results)
    report.write("fig3", finding(), tmp_path, quick=False)
    page = tmp_path / "page.md"
    page.write_text("a\n<!-- verdicts: made by docs/results.py -->\nstale\n<!-- verdicts: end -->\nb\n")
    results.fill(page, "verdicts", list(results.verdicts(tmp_path)))
    text = page.read_text()
    assert "| fig3 | 1 < 2 | - | <&> | **n** |" in text and "stale" not in text
    assert text.startswith("a\n") and text.endswith("b\n") and "1 of 1 on rigid plant, 0 of 1 on MuJoCo" in text


def test_thinning_keeps_peaks_and_ends() -> None:
    y = np.zeros(100_000)
    y[54_321], y[98_765] = 1.0, -2.0
    x, thin = thinned(np.arange(100_000), y)
    assert len(x) <= 1202
    assert (thin.max(), thin.min()) == (1.0, -2.0)
    assert (x[0], x[-1]) == (0, 99_999)


def test_every_experiment_is_there_and_says_what_it_needs() -> None:
    for name in EXPERIMENTS:
        module = importlib.import_module(f"sim.reproduce.experiments.{name}")
        quick, full = module.tasks(Effort(quick=True)), module.tasks(Effort())
        assert quick
        assert sum(t.cost for t in quick.values()) <= sum(t.cost for t in full.values())
    offsets, forces = fig8.READINGS["torso"][3][0]
    assert offsets >= 25 and forces >= 31


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["fig33"], "no experiment 'fig33'; did you mean fig3? There are: all, fig3"),
        (["--workers", "0"], "--workers 0"),
        (["--controller.kp", "1"], "--controller.kp"),
        (["--fast"], "unknown option --fast"),
        (["fig3", "--plant.kind", "rigid"], "--plant.kind rigid: is set by each experiment"),
        (["fig3", "--steps", "3"], "--steps 3: is set by each experiment"),
        (["fig3", "--controller", "zd-pd"], "--controller zd-pd: is what every controller is compared with"),
        (["fig3", "--out", "/proc/nowhere"], "--out /proc/nowhere: cannot be written"),
    ],
)
def test_bad_input_is_named(capsys, words: list[str], message: str) -> None:
    assert cli.main(["reproduce", *words]) == 2
    assert message in capsys.readouterr().err
