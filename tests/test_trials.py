"""Campaigns: pure trials, the same results whoever runs them, nothing lost to a kill, one line for bad input."""

import contextlib
import dataclasses
import errno
import html
import json
import os
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
from pathlib import Path

import misdeeds
import pytest
from spoken import spoken

from sim import cli
from sim.errors import UserError
from sim.scenario import Scenario
from sim.trials.plan import Plan, load_plan
from sim.trials.plan.plan import differences, from_toml, shipped_names, to_toml
from sim.trials.report import report
from sim.trials.report.findings import random_findings, sides
from sim.trials.run import TrialResult, TrialSpec, run_plan, run_trial, workers
from sim.trials.run.folder import FILE
from sim.trials.run.origin import origin
from sim.trials.run.recall import open_results, stored_scenario
from sim.trials.run.result import result_without_times
from sim.trials.run.store import Store
from sim.trials.run.trial import trial_scenario, trial_seed

PLAN = """
name = "small"
seed = 11
controllers = ["zd-pd"]

[scenario]
steps = 1

[[grid]]
[[grid.axes]]
paths = ["pushes.0.force"]
also = ["pushes.0.step = 1"]
low = -60
high = 60
count = 5

[[margin]]
[[margin.axes]]
name = "tilt"
paths = ["start.torso_offset"]
nominal = 0
low = 0
high = 0.8
tolerance = 0.1
scan = 2

[[montecarlo]]
trials = 12
[[montecarlo.axes]]
paths = ["sensors.angle_noise"]
distribution = "uniform"
low = 0
high = 0.01
[[montecarlo.axes]]
paths = ["plant.mass_factor.torso"]
distribution = "log-normal"
centre = 1
spread = 0.4
"""


@pytest.fixture
def plan() -> Plan:
    return from_toml(PLAN)


@pytest.fixture(scope="module")
def reference() -> list[TrialResult]:
    return [result_without_times(result) for result in run_plan(from_toml(PLAN), workers=1)]


def same(results) -> list[TrialResult]:
    return [result_without_times(result) for result in results]


def write(folder: Path, text: str = PLAN) -> str:
    path = folder / "small.toml"
    path.write_text(text)
    return str(path)


def test_plans_read_back_equal_and_shipped_ones_are_there(plan: Plan) -> None:
    assert shipped_names() == [
        "atlas",
        "bodies",
        "headlines",
        "montecarlo",
        "payload",
        "pushes",
        "reach",
        "reliability",
        "tuning",
        "weights",
    ]
    for one in (plan, *map(load_plan, shipped_names())):
        assert from_toml(to_toml(one)) == one and from_toml(to_toml(one)).hash() == one.hash()


def test_a_trial_is_a_pure_function(plan: Plan, reference: list[TrialResult]) -> None:
    spec = TrialSpec(plan=plan, controller="zd-pd", index=20)
    first, again = run_trial(spec), run_trial(spec)
    assert result_without_times(first) == result_without_times(again)
    assert result_without_times(first) in reference
    assert first.state_digest and first.ticks > 0 and first.rms_torque_all_Nm


def test_every_trial_is_there_once_and_both_ends_occur(plan: Plan, reference: list[TrialResult]) -> None:
    ids = [row.trial for row in reference]
    assert len(ids) == len(set(ids)) and {row.study for row in reference} == {"grid", "margin", "montecarlo"}
    assert {row.outcome for row in reference} == {"completed", "fell"}
    assert all(row.survived == (row.outcome == "completed") for row in reference)
    assert all(row.fall_reason for row in reference if row.outcome == "fell")


def test_two_workers_find_what_one_finds(plan: Plan, reference: list[TrialResult]) -> None:
    assert same(run_plan(plan, workers=2)) == reference


def test_controllers_are_given_the_same_draws() -> None:
    plan = from_toml(PLAN.replace('["zd-pd"]', '["zd-pd", "c-mpc"]'))
    for index in (3, 20):
        one, other = (trial_scenario(plan, kind, index) for kind in plan.controllers)
        assert dataclasses.replace(one, controller=other.controller) == other
        assert one.seed == trial_seed(plan, index)
    assert trial_seed(plan, 3) != trial_seed(plan, 4) != trial_seed(dataclasses.replace(plan, seed=12), 4)


def test_an_exception_is_an_outcome_and_wall_time_is_bounded(plan: Plan) -> None:
    broken = dataclasses.replace(plan, scenario=dataclasses.replace(plan.scenario, walker="nowhere"))
    result = run_trial(TrialSpec(plan=broken, controller="zd-pd", index=0))
    assert result.outcome == "error" and not result.survived and "nowhere" in result.message
    hasty = dataclasses.replace(plan, wall_limit=1e-6)
    result = run_trial(TrialSpec(plan=hasty, controller="zd-pd", index=0))
    assert result.outcome == "gave up" and not result.known and "wall time" in result.message


def test_a_full_disk_is_no_result_of_the_trial(plan: Plan, tmp_path: Path, monkeypatch) -> None:
    from sim.log.write.container import McapFile

    def full(self, data, index) -> None:
        raise UserError("log: cannot be written") from OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(McapFile, "chunk", full)
    spec = TrialSpec(plan=dataclasses.replace(plan, log_every=1), controller="zd-pd", index=0, logs=str(tmp_path))
    with pytest.raises(UserError, match="disk is full"):
        run_trial(spec)
    assert list(tmp_path.iterdir()) == []


def test_a_killed_campaign_goes_on_where_it_was(tmp_path: Path, reference: list[TrialResult]) -> None:
    """Kill -9 of the parent in mid-plan, twice; then the same command to its end."""
    out = tmp_path / "out"
    command = [sys.executable, "-m", "sim", "trials", write(tmp_path), "--out", str(out), "--workers", "1"]
    for killed in (2, 9):
        process = subprocess.Popen(command, cwd=Path(__file__).parent.parent, stderr=subprocess.DEVNULL)
        while _count(out) < killed and process.poll() is None:
            time.sleep(0.01)
        process.send_signal(signal.SIGKILL)
        process.wait()
        assert process.returncode == -signal.SIGKILL
    before = _count(out)
    assert 9 <= before < len(reference)
    results = run_plan(load_plan(str(tmp_path / "small.toml")), out, workers=1)
    assert same(results) == reference


def _count(out: Path) -> int:
    if not (out / FILE).exists():
        return 0
    try:
        with sqlite3.connect(f"file:{out / FILE}?mode=ro", uri=True) as db:
            return int(db.execute("SELECT count(*) FROM trials").fetchone()[0])
    except sqlite3.OperationalError:
        return 0


def test_the_command_leaves_database_table_plots_and_page(plan: Plan, tmp_path: Path, capsys) -> None:
    text = PLAN.replace('name = "small"', 'name = "small"\nlogs = "falls"\nlog_every = 7')
    assert cli.main(["trials", write(tmp_path, text), "--out", str(tmp_path / "out"), "--workers", "1"]) == 0
    out = capsys.readouterr().out
    page = (tmp_path / "out/report.html").read_text()
    assert "grid points" in out and "McNemar" not in out and "report.html" in out
    for words in ("<svg", "tilt", "are completed", "angle_noise", "Falls, errors and trials given up", "zd-pd/"):
        assert words in page
    assert "http://" not in page.replace("http://www.w3.org", "") and "<script" not in page
    assert list((tmp_path / "out/plots").glob("*.svg"))
    rows = (tmp_path / "out/results.csv").read_text().splitlines()
    with Store(tmp_path / "out" / FILE) as store:
        results = list(store.results())
    assert len(rows) == len(results) + 1
    logs = {path.name for path in (tmp_path / "out/logs").iterdir()}
    assert logs == {row.log for row in results if row.outcome == "fell" or row.trial % 7 == 0}
    assert logs == {f"zd-pd-{row.trial}.mcap" for row in results if row.log}

    fell = next(row for row in results if row.outcome == "fell")
    assert cli.main(["trials", "show", str(tmp_path / "out"), "--trial", f"zd-pd/{fell.trial}"]) == 0
    assert fell.fall_reason in capsys.readouterr().out
    argv = ["run", "--from-trial", f"{tmp_path / 'out'}#zd-pd/{fell.trial}", "--no-log", "--json"]
    assert cli.main(argv) == 0
    again = json.loads(capsys.readouterr().out)
    assert (again["outcome"], again["ticks"], again["state_digest"]) == ("fell", fell.ticks, fell.state_digest)
    assert stored_scenario(f"{tmp_path / 'out'}#zd-pd/{fell.trial}").seed == fell.seed


THREE = """
seed = 2
[scenario]
steps = 1
[[margin]]
name = "tilt"
[[margin.axes]]
paths = ["start.torso_lean"]
nominal = 0
low = -0.9
high = 0.9
tolerance = 0.45
typical = 0.3
scan = 1
[[montecarlo]]
name = "pushed"
trials = 4
[[montecarlo.axes]]
paths = ["pushes.0.force"]
also = ["pushes.0.step = 1"]
distribution = "uniform"
low = -80
high = 80
"""


@pytest.fixture(scope="module")
def three(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("three")
    argv = ["trials", write(folder, THREE), "--out", str(folder / "out"), "--workers", "1", "--quiet"]
    assert cli.main([*argv, "--controllers", "c-mpc,zd-pd,c-mpc-ltv"]) == 0
    return folder / "out"


def test_all_controllers_are_compared_with_the_first(three: Path) -> None:
    with open_results(three) as results:
        plan = results.plan
        assert plan.controllers == ("c-mpc", "zd-pd", "c-mpc-ltv")
        found = random_findings(results, plan.montecarlo[0])
    assert found.reference == "c-mpc" and tuple(found.pairs) == plan.controllers[1:] == tuple(found.p)
    for other, pair in found.pairs.items():
        draws = zip(found.results["c-mpc"], found.results[other], strict=True)
        assert pair.first == sum(a.survived and not b.survived for a, b in draws) and found.p[other] >= pair.p


def test_the_pages_say_for_every_side_and_controller_what_breaks(three: Path) -> None:
    report, breaks = ((three / name).read_text() for name in ("report.html", "breaks.html"))
    with open_results(three) as results:
        rows, plan = list(results), results.plan
        falls = [side for side in sides(results, plan.margin[0]) if side.fall]
    assert {side.controller for side in falls} == set(plan.controllers)
    for side in falls:
        assert side.fall.cause and f"{side.controller}/{side.fall.trial} " in breaks
        assert html.escape(side.fall.proof) in breaks
    assert all(row.cause for row in rows if row.outcome == "fell")
    assert not any(row.cause for row in rows if row.survived)
    assert "Breaks first" in report and "breaks.html" in report and "draw by draw" in report


def test_margins_whose_search_is_not_finished_are_left_out(three: Path, tmp_path: Path) -> None:
    with open_results(three) as results, Store(tmp_path / FILE, write=True) as part:
        part.set_plan(results.plan)
        for row in results.store.results("c-mpc"):
            if row.study == "tilt" and row.axis_values["start.torso_lean"] <= 0.0:
                part.add(row)
    assert cli.main(["trials", "report", str(tmp_path)]) == 0
    with open_results(tmp_path) as results:
        found = sides(results, results.plan.margin[0])
        assert {(side.controller, side.sign) for side in found} == {("c-mpc", -1)}
    assert "Not all trials have been run yet" in (tmp_path / "report.html").read_text()


def test_the_benchmark_of_trials_has_a_rate_for_each_controller(capsys) -> None:
    assert cli.main(["trials", "bench", "--controllers", "zd-pd", "--trials", "4", "--json"]) == 0
    rows = {row["name"]: row for row in json.loads(capsys.readouterr().out)["figures"]}
    one = rows["zd-pd, 1 worker"]["value"]
    assert one > 0.0 and rows["zd-pd, CPU time of the campaign's process a trial"]["value"] > 0.0
    for name, row in rows.items():
        if "efficiency" in name:
            assert row["value"] == pytest.approx(rows["zd-pd, 2 workers"]["value"] / (2 * one))


def test_results_come_as_a_data_frame(plan: Plan) -> None:
    pytest.importorskip("pandas")
    frame = run_plan(from_toml(PLAN.split("[[margin]]")[0]), workers=1).frame()
    assert len(frame) == 5 and frame["axis: pushes.0.force"].tolist() == [-60, -30, 0, 30, 60]


def test_a_changed_plan_is_refused_and_restart_keeps_the_old(plan: Plan, tmp_path: Path, capsys) -> None:
    grid = PLAN.split("[[margin]]")[0]
    out = str(tmp_path / "out")
    assert cli.main(["trials", write(tmp_path, grid), "--out", out, "--workers", "1"]) == 0
    write(tmp_path, grid.replace("seed = 11", "seed = 12").replace("high = 60", "high = 70"))
    again = ["trials", str(tmp_path / "small.toml"), "--out", out, "--workers", "1"]
    capsys.readouterr()
    assert cli.main(again) == 2
    err = capsys.readouterr().err
    assert "seed: 11 -> 12" in err and "grid.0.axes.0.high: 60.0 -> 70.0" in err and "--restart" in err
    assert cli.main([*again, "--restart"]) == 0
    (backup,) = (tmp_path / "out").glob("backup-*")
    with Store(backup / FILE) as store:
        assert len(list(store.results())) == 5 and store.plan().seed == 11


def test_differences_name_what_was_added_and_taken_away(plan: Plan) -> None:
    less = dataclasses.replace(plan, montecarlo=())
    assert any(line.startswith("montecarlo.0.trials: 12 -> (absent)") for line in differences(plan, less))


def test_results_of_a_newer_version_are_refused(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    with sqlite3.connect(tmp_path / "out" / FILE) as db:
        db.execute("PRAGMA user_version = 99")
    with pytest.raises(UserError, match="version 99; this program reads 3: use a newer one"):
        Store(tmp_path / "out" / FILE)


def test_results_of_an_older_version_are_refused_and_set_aside_by_restart(plan: Plan, tmp_path: Path) -> None:
    with sqlite3.connect(tmp_path / FILE) as db:
        db.execute("PRAGMA user_version = 1")
    one = dataclasses.replace(plan, grid=(), margin=(), montecarlo=(dataclasses.replace(plan.montecarlo[0], trials=1),))
    with pytest.raises(UserError, match="version 1; this program reads 3: run them again, with --restart"):
        run_plan(one, tmp_path, workers=1)
    assert len(list(run_plan(one, tmp_path, workers=1, restart=True))) == 1


def test_what_is_no_database_is_refused(tmp_path: Path) -> None:
    (tmp_path / FILE).write_text("no database " * 100)
    with pytest.raises(UserError, match="must be the results of a campaign"):
        Store(tmp_path / FILE)


def test_a_full_disk_stops_the_campaign_and_keeps_what_there_is(tmp_path: Path, reference) -> None:
    store = Store(tmp_path / FILE, write=True)
    pages = store._db.execute("PRAGMA page_count").fetchone()[0]
    store._db.execute(f"PRAGMA max_page_count = {pages + 1}")
    with pytest.raises(UserError, match=r"full; results so far are kept"):
        for number in range(1000):
            store.add(dataclasses.replace(reference[0], trial=number))
    kept = len(store.done())
    store.close()
    assert 0 < kept == len(Store(tmp_path / FILE).done())


def test_a_second_campaign_in_the_same_folder_is_refused(plan: Plan, tmp_path: Path) -> None:
    from sim.trials.run.folder import locked

    with locked(tmp_path), pytest.raises(UserError, match="another campaign"), locked(tmp_path):
        pass


GRID = PLAN.split("[[margin]]")[0]


def test_trials_given_up_are_no_falls_and_can_be_tried_again(tmp_path: Path, capsys) -> None:
    """With a wall limit that no trial keeps; then with a wide one, which changes no result."""
    plan, out = from_toml(GRID.replace("[scenario]", "wall_limit = 1e-6\n[scenario]")), tmp_path / "out"
    with run_plan(plan, out, workers=2).store as store:
        assert {row.outcome for row in store.results()} == {"gave up"} and store.counts()["zd-pd"].unknown == 5
    assert cli.main(["trials", "report", str(out)]) == 0
    shown = capsys.readouterr().out
    page = (out / "report.html").read_text()
    assert "survives 0 of 0" in shown and "5 trials have no result" in shown
    assert "0 walked, 0 fell, 5 without a result" in page and "5 have no result" in page
    assert cli.main(["trials", "retry", str(out), "--workers", "1", "--quiet", "--wall-limit", "100"]) == 0
    with Store(out / FILE) as store:
        assert {row.outcome for row in store.results()} == {"completed", "fell"} and len(store.done()) == 5


def test_results_of_another_origin_are_refused_unless_told(tmp_path: Path) -> None:
    plan, out = from_toml(GRID), tmp_path / "out"
    run_plan(plan, out, workers=1).store.close()
    with Store(out / FILE, write=True) as store:
        (facts,) = store.origins().values()
        assert any("rabbit.xml" in name for name in json.loads(facts)["files"])
        store._db.execute("DELETE FROM trials WHERE trial = 2")
        store._db.execute("UPDATE origins SET key = 'old', facts = ?", (facts.replace('"numpy": "', '"numpy": "0.'),))
        store._db.execute("UPDATE trials SET origin = 'old'")
    with pytest.raises(UserError, match=r"found with something else: numpy 0\.\d.*--mix"):
        run_plan(plan, out, workers=1)
    with run_plan(plan, out, workers=1, mix=True).store as store:
        assert len(store.done()) == 5 and len(store.origins_of("zd-pd")) == 2


def test_an_edited_gait_is_another_origin(tmp_path: Path) -> None:
    gait = tmp_path / "paper.toml"
    text = (Path(__file__).parent.parent / "models/rabbit/gaits/paper.toml").read_text()
    gait.write_text(text)
    plan = from_toml(GRID.replace("[scenario]", f'[scenario]\ngait = "{gait}"'))
    one = dataclasses.replace(plan, grid=(dataclasses.replace(plan.grid[0], axes=(_fewer(plan.grid[0].axes[0]),)),))
    run_plan(one, tmp_path / "out", workers=1).store.close()
    gait.write_text(text + "# edited")
    with pytest.raises(UserError, match=r"file .*paper\.toml: \w+ -> \w+"):
        run_plan(one, tmp_path / "out", workers=1)


def test_results_are_added_to_from_a_program_and_a_walker_that_were_moved(tmp_path: Path) -> None:
    origins = []
    for place in ("before", "after"):
        shutil.copytree(Path(__file__).parent.parent / "models/rabbit", tmp_path / place / "rabbit")
        law = tmp_path / place / "law.py"
        law.write_text("def make(walker, settings):\n    raise NotImplementedError\n")
        scenario = dataclasses.replace(Scenario(), walker=str(tmp_path / place / "rabbit"))
        origins.append(origin(scenario, f"{law}:make"))
    assert origins[0] == origins[1]
    assert {"rabbit/rabbit.xml", "rabbit/rabbit.urdf", "rabbit/gaits/paper.toml", "law.py"} == {
        *json.loads(origins[0])["files"]
    }


def _fewer(axis):
    return dataclasses.replace(axis, count=1)


def test_trials_that_abort_hang_raise_or_return_nan_cost_no_other_trial() -> None:
    """A small version of the proof in `test_trials_campaign`: one of each in twenty."""
    clean = same(run_plan(from_toml(misdeeds.plan(20, False, 60.0)), workers=2))
    misdeeds.check(same(run_plan(from_toml(misdeeds.plan(20, True, 10.0)), workers=2)), clean)


def test_no_two_trials_have_the_same_seed() -> None:
    plan = from_toml(PLAN.replace("trials = 12", "trials = 5000"))
    seeds = [trial_seed(plan, index) for index in range(5000)]
    assert len(set(seeds)) == len(seeds)


def test_the_first_interrupt_ends_a_campaign(tmp_path: Path) -> None:
    """In the middle of long trials; SIGHUP, of a connection that is lost, as Ctrl-C."""
    text = PLAN.replace("steps = 1", "steps = 2000\ntime_limit = 3600")
    for signum, code in ((signal.SIGINT, 130), (signal.SIGHUP, 129)):
        out = tmp_path / signum.name
        command = [sys.executable, "-m", "sim", "trials", write(tmp_path, text), "--out", str(out), "--workers", "2"]
        process = subprocess.Popen(command, cwd=Path(__file__).parent.parent, stderr=subprocess.PIPE, text=True)
        while not (out / FILE).exists() and process.poll() is None:
            time.sleep(0.01)
        time.sleep(2.0)
        process.send_signal(signum)
        _, err = process.communicate(timeout=60)
        assert process.returncode == code and len(spoken(err)) == 1 and signum.name in err, err


def test_a_scheduler_that_ends_before_the_first_trial_is_gone(plan: Plan) -> None:
    class Gone:
        def run(self, function):
            return {"tcp://one": function()}

        def nthreads(self):
            raise ConnectionRefusedError(111, "Connection refused")

    execute = workers.cluster(workers.Campaign.of(plan, None), Gone())
    with pytest.raises(UserError, match="the scheduler is gone"):
        next(execute(iter([]), lambda: False))


DAMAGE = {
    "empty": lambda db: db.write_bytes(b""),
    "header": lambda db: db.write_bytes(b"x" * 100 + db.read_bytes()[100:]),
    "half": lambda db: db.write_bytes(db.read_bytes()[: db.stat().st_size // 2]),
    "zeros in the middle": lambda db: db.write_bytes(db.read_bytes()[:4096] + bytes(8192) + db.read_bytes()[12288:]),
    "page size": lambda db: db.write_bytes(db.read_bytes()[:16] + b"\x00\x07" + db.read_bytes()[18:]),
    "text": lambda db: db.write_text("no database " * 1000),
    "no meta": "DROP TABLE meta",
    "no plan": "DELETE FROM meta",
    "a plan that is none": "UPDATE meta SET value = 'x = ' WHERE key = 'plan'",
    "a plan of another version": "UPDATE meta SET value = 'colour = 1' WHERE key = 'plan'",
    "a plan that is a blob": "UPDATE meta SET value = x'ff00fe' WHERE key = 'plan'",
    "no trials": "DROP TABLE trials",
    "another column": "ALTER TABLE trials ADD COLUMN colour TEXT",
    "a column less": "ALTER TABLE trials DROP COLUMN steps",
    "words for a number": "UPDATE trials SET steps = 'many'",
    "values that are none": "UPDATE trials SET \"values\" = '{'",
    "values of another kind": "UPDATE trials SET \"values\" = '[1]'",
    "a cause that is none": "UPDATE trials SET cause = 'magic', evidence = '{}'",
    "a speed that is none": 'UPDATE trials SET evidence = \'{"least_speed_m_s": "fast"}\'',
    "criteria that are none": "UPDATE trials SET judged_by = '[]'",
    "a blob": "UPDATE trials SET outcome = x'ff'",
}


@pytest.fixture(scope="module")
def small_results(tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("results") / "out"
    run_plan(from_toml(GRID), out, workers=1).store.close()
    return out


@pytest.mark.parametrize("damage", DAMAGE)
def test_damaged_results_are_one_line(damage: str, small_results: Path, tmp_path: Path, capsys) -> None:
    out = tmp_path / "out"
    shutil.copytree(small_results, out)
    how = DAMAGE[damage]
    if callable(how):
        how(out / FILE)
    else:
        with contextlib.closing(sqlite3.connect(out / FILE)) as db:
            db.execute(how)
            db.commit()
    again = ["trials", str(tmp_path / "small.toml"), "--out", str(out), "--workers", "1", "--quiet"]
    write(tmp_path, GRID)
    codes = []
    for argv in (["trials", "show", str(out), "--trial", "zd-pd/0"], ["trials", "report", str(out)], again):
        codes.append(cli.main(argv))
        err = capsys.readouterr().err
        assert codes[-1] in (0, 2) and err.count("\n") == (codes[-1] == 2), err
    assert codes[1] == 2  # what is damaged is never shown as if it were whole


def test_results_on_a_disk_that_cannot_be_written_are_shown(small_results: Path, monkeypatch, capsys) -> None:
    """SQLite cannot make its shared memory there."""
    connect = sqlite3.connect

    def read_only(place, *rest, **how):
        if "mode=ro" in str(place) and "immutable" not in str(place):
            raise sqlite3.OperationalError("unable to open database file")
        return connect(place, *rest, **how)

    monkeypatch.setattr(sqlite3, "connect", read_only)
    assert cli.main(["trials", "show", str(small_results), "--trial", "zd-pd/0"]) == 0
    assert "outcome" in capsys.readouterr().out


def test_the_results_of_a_killed_campaign_are_shown_there_too(small_results: Path, tmp_path: Path, monkeypatch) -> None:
    """The write-ahead log that it left has results which the file lacks."""
    shutil.copytree(small_results, tmp_path / "out")
    file, connect = tmp_path / "out" / FILE, sqlite3.connect
    with contextlib.closing(connect(file, isolation_level=None)) as db:
        db.execute("PRAGMA journal_mode = WAL")
        db.execute("UPDATE trials SET message = 'late'")
        shutil.copytree(tmp_path / "out", tmp_path / "left")

    def read_only(place, *rest, **how):
        if "mode=ro" in str(place):
            raise sqlite3.OperationalError("unable to open database file")
        return connect(place, *rest, **how)

    monkeypatch.setattr(sqlite3, "connect", read_only)
    with Store(tmp_path / "left" / FILE) as store:
        assert {row.message for row in store.results()} == {"late"}


def test_names_from_a_plan_do_not_break_its_page(tmp_path: Path, capsys) -> None:
    """`</title><script>`, escape sequences of terminals, folders in names of plots."""
    assert cli.main(["trials", write(tmp_path, UGLY), "--out", str(tmp_path / "out"), "--workers", "1"]) == 0
    out, err = capsys.readouterr()
    assert "\x1b" not in out + err and "Glyph" not in err
    for name in ("report.html", "breaks.html"):
        page = (tmp_path / "out" / name).read_text()
        assert "<script>alert" not in page and "<img src=x" not in page and "<svg onload" not in page
        assert page.count("</title>") == page.count("<title>")
    assert {path.parent for path in (tmp_path / "out").rglob("*.svg")} == {tmp_path / "out/plots"}


AXIS = 'paths = ["plant.ground.slope"]\n'
RANDOM = 'distribution = "uniform"\nlow = 0\nhigh = 0.1\n'
UGLY = f"""
name = "<script>alert(1)</script>"
description = "<img src=x onerror=alert(2)>"
controllers = ["zd-pd"]
[scenario]
steps = 1
time_limit = 0.05
[[margin]]
name = "</title><script>alert(3)</script>"
[[margin.axes]]
name = "\\"><svg onload=alert(4)> ../../x"
paths = ["plant.mass_factor.torso"]
nominal = 1.0
low = 0.5
high = 2.0
tolerance = 0.2
scale = "log"
scan = 1
typical = 1.1
[[montecarlo]]
name = "mc<b> 歩行"
trials = 3
[[montecarlo.axes]]
name = "x\\u001b[31m<i>"
{AXIS}{RANDOM}"""


ONE = f"[[montecarlo.axes]]\n{AXIS}{RANDOM}"
MARGIN = f"[[margin]]\n[[margin.axes]]\n{AXIS}nominal = 0\n"
BAD = {
    '[[grid]]\n[[grid.axes]]\npaths = ["plant.ground.slop"]\nvalues = [1]': ["did you mean plant.ground.slope"],
    '[[grid]]\n[[grid.axes]]\npaths = ["plant.ground"]\nvalues = [1]': ["plant.ground: no such setting"],
    "[[grid]]": ["grid 'grid': has no axes"],
    f"[[grid]]\n[[grid.axes]]\n{AXIS}": ["is empty or given twice", "[rad]"],
    f"[[grid]]\n[[grid.axes]]\n{AXIS}values = [2]": ["plant.ground.slope = 2.0 rad", "pi/2"],
    f"[[grid]]\n[[grid.axes]]\n{AXIS}step = 1": ["grid.0.axes.0.step: unknown key"],
    '[[grid]]\n[[grid.axes]]\npaths = ["plant.mass_factor.torso"]\nvalues = [-1]': ["-1.0 ratio", "above 0"],
    '[[grid]]\n[[grid.axes]]\npaths = ["sensors.latency"]\nvalues = [0.5]': ["sensors.latency = 0.5", "integer"],
    f"[[margin]]\n[[margin.axes]]\n{AXIS}nominal = 1\nlow = 0\nhigh = 0.5\ntolerance = 0.1": ["must be in this order"],
    f"[[margin]]\n[[margin.axes]]\n{AXIS}nominal = 0\nlow = 0\nhigh = 0.5\ntolerance = 0": [
        "tolerance = 0: must be a number above 0"
    ],
    f"[[margin]]\n[[margin.axes]]\n{AXIS}nominal = 0\nlow = 0\nhigh = 0.5\ntolerance = 1": ["must divide the range"],
    f'[[montecarlo]]\n[[montecarlo.axes]]\n{AXIS}distribution = "normal"': ["needs centre and spread [rad]"],
    f'[[montecarlo]]\n[[montecarlo.axes]]\n{AXIS}distribution = "gauss"': ["one of normal, uniform"],
    "[[montecarlo]]\ntrials = 0": ["trials = 0 trials", "1 or above"],
    f'[[montecarlo]]\n[[montecarlo.axes]]\npaths = ["seed"]\n{RANDOM}': ["seed is set by each trial"],
    '[[grid]]\n[[grid.axes]]\npaths = ["controller.kind"]\nwords = ["zd-pd"]': ["controller.kind is set by each trial"],
    f"[[montecarlo]]\n{ONE}{ONE}": ["two axes are called 'plant.ground.slope'"],
    f'[[montecarlo]]\n{ONE}{ONE}name = "b"': ["axes 'plant.ground.slope' and 'b' both set plant.ground.slope"],
    f'[[montecarlo]]\n{ONE}[[montecarlo.axes]]\npaths = ["sensors.angle_noise"]\n{RANDOM}'
    'also = ["plant.ground.slope = 0.1"]': ["also sets plant.ground.slope", "axis 'plant.ground.slope' sets"],
    f'[[montecarlo]]\n{ONE}also = ["seed = 3"]': ["also sets seed, which is set by each trial"],
    f"[[grid]]\n[[grid.axes]]\n{AXIS}low = 0\nhigh = 0.1\ncount = 3000000": ["3000000 trials", "2000000 or fewer"],
    f"{MARGIN}low = 0\nhigh = 1e9\ntolerance = 1e-300": ["high = 1e+09", "is more than 1000000 parts"],
    f"{MARGIN}low = -0.1\nhigh = 0.1\ntolerance = 0.1\ntypical = -1": ["typical = -1: must be above 0, or 0 for none"],
    '[[margin]]\n[[margin.axes]]\npaths = ["plant.ground.friction"]\nnominal = 0.6\nlow = 0.1\nhigh = 1\n'
    'tolerance = 0.1\nscale = "log"\ntypical = 1': ["typical = 1", "a ratio above 1"],
    "": ["the plan has no study"],
    'controllers = ["pid"]': ["'pid'", "c-mpc, zd-pd"],
    'also = "x"': ["also: unknown key"],
    "seed = ": ["not valid TOML"],
    "seed = " + "[" * 5000 + "]" * 5000: ["nested too deeply"],
    "[scenario]\nstep = 3": ["scenario.step", "did you mean scenario.steps"],
}


@pytest.mark.parametrize("text", BAD)
def test_a_bad_plan_is_one_line_and_exit_code_2(text: str, tmp_path: Path, capsys) -> None:
    assert cli.main(["trials", write(tmp_path, text), "--out", str(tmp_path / "out")]) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1 and "small.toml" in err
    for words in BAD[text]:
        assert words in err, err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("trials", "needs a plan"),
        ("trials atlas", "--out"),
        ("trials atlass --out o", "did you mean atlas"),
        ("trials nowhere.toml --out o", "cannot be read"),
        ("trials atlas --out o --workers 0", "--workers 0"),
        ("trials atlas --out o --workers 1 --cluster tcp://x:1", "--cluster"),
        ("trials atlas --out /proc/x", "/proc/x"),
        ("trials atlas --out o --controllers zdpd", "did you mean zd-pd"),
        ("trials atlas --out o --controllers zd-pd,zd-pd", "zd-pd is given twice"),
        ("trials bench --trials 1", "must be 4 or above"),
        ("trials show nowhere --trial c-mpc/1", "no results there"),
        ("run --from-trial nowhere", "DIR#CONTROLLER/NUMBER"),
        ("run --from-trial nowhere#c-mpc/1", "no results there"),
        ("run push-25N --from-trial nowhere#c-mpc/1", "push-25N"),
    ],
)
def test_a_bad_command_is_one_line_and_exit_code_2(line: str, words: str, tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    assert cli.main(line.split()) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1 and words in err
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize("trial", ["c-mpc/3", "zd-pd/x", "zd-pd", "zd-pd/99999", "zdpd/1"])
def test_an_unknown_trial_is_refused(trial: str, plan: Plan, tmp_path: Path, capsys) -> None:
    with Store(tmp_path / FILE, write=True) as store:
        store.set_plan(plan)
    assert cli.main(["trials", "show", str(tmp_path), "--trial", trial]) == 2
    assert "trial" in capsys.readouterr().err


def test_an_unreachable_cluster_is_refused(monkeypatch) -> None:
    pytest.importorskip("distributed")
    from sim.trials.run import workers

    monkeypatch.setattr(workers, "CONNECT_TIMEOUT", 0.5)
    with pytest.raises(UserError, match=r"--cluster tcp://127\.0\.0\.1:9: no scheduler answers"):
        workers.connect("tcp://127.0.0.1:9")


def test_a_cluster_finds_the_same_though_a_worker_is_killed(plan: Plan, reference: list[TrialResult]) -> None:
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, host="127.0.0.1"
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        victims = list(client.run(os.getpid).values())

        def kill(progress) -> None:
            if progress.new == 4:
                os.kill(victims[0], signal.SIGKILL)

        assert same(run_plan(plan, client=client, report=kill)) == reference


def test_a_table_that_cannot_be_finished_leaves_the_last_one(tmp_path):
    def failing():
        yield from ()
        raise OSError("disk")

    (tmp_path / "results.csv").write_text("as it was")
    with pytest.raises(OSError, match="disk"):
        report._write_csv(failing(), tmp_path / "results.csv")
    assert [(one.name, one.read_text()) for one in tmp_path.iterdir()] == [("results.csv", "as it was")]


def test_plots_of_an_older_report_go(tmp_path):
    svg = "<svg><title>{}</title><path stroke='currentColor'/></svg>"
    for titles in (("one", "two"), ("one", "three & four")):
        report._write_plots("".join(svg.format(title) for title in titles), tmp_path / "plots")
    assert sorted(path.name for path in (tmp_path / "plots").iterdir()) == ["000-one.svg", "001-three-four.svg"]
    assert "#000" in (tmp_path / "plots" / "000-one.svg").read_text()
