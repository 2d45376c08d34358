"""What any controller could hold: the model is the belief's, the walk found obeys it, and bad questions are refused."""

import dataclasses
import json
import subprocess
import sys

import casadi as ca
import numpy as np
import pytest
from conftest import RABBIT, ROOT
from spoken import spoken

import sim
from controller.belief import load_gait
from controller.belief.lumped import H
from controller.common.errors import UserError
from controller.limit import mechanics
from controller.limit.question import Question
from controller.limit.solve import Search, answer
from controller.limit.walk import state_at
from sim import cli
from sim.bridge.limits import AXES, ask, fingerprint
from sim.scenario import Scenario, with_values
from sim.trials.plan import load_plan
from sim.trials.plan.limits import Limits, read_limits, shipped_limits
from sim.trials.report.report import write_report
from sim.trials.run import run_plan
from sim.trials.run.recall import open_results

GAIT = "paper-polished"


def functions(model):
    links = mechanics.links_of(model)
    p, w, after, a = (ca.SX.sym(name, 5) for name in ("p", "w", "after", "a"))
    u, push = ca.SX.sym("u", 4), ca.SX.sym("push")
    rows = [
        mechanics.imbalance(links, p, w, a, u, push),
        ca.vertcat(*mechanics.stance_force(links, p, w, a, push)),
        ca.vertcat(*mechanics.swing_foot(links, p)),
    ]
    return ca.Function("f", [p, w, a, u, push], rows), ca.Function(
        "g", [p, w, after], [mechanics.impact_imbalance(links, p, w, after)]
    )


def agrees(model, states, rng):
    motion, impact = functions(model)
    for q, dq in states:
        u = rng.uniform(-50.0, 50.0, 4)
        missing, force, foot = motion(H @ q, H @ dq, H @ model.acceleration(q, dq, u), u, 0.0)
        assert np.abs(np.array(missing)).max() < 1e-10
        assert np.allclose(np.array(force).ravel(), model.stance_force(q, dq, u)[0], atol=1e-9)
        assert np.allclose(np.array(foot).ravel(), model.swing_foot(q, dq)[:2], atol=1e-12)
        _, after = model.impact(q, dq)
        assert np.abs(np.array(impact(H @ q, H @ dq, H @ after))).max() < 1e-10


def test_the_model_is_the_beliefs(model, random_states):
    agrees(model, random_states(50), np.random.default_rng(0))


def test_a_load_is_a_walker_with_a_heavier_torso(model):
    factor = ca.SX.sym("factor")
    links = mechanics.links_of(model, factor)
    A = ca.Function("A", [factor], [links.A, links.mass, links.b])
    plain = A(1.0)
    assert np.allclose(np.array(plain[0]), model.lumped.A) and float(plain[1]) == pytest.approx(model.lumped.mass)
    assert float(A(3.0)[1]) == pytest.approx(model.lumped.mass + 2.0 * model.torso.mass)


@pytest.fixture(scope="module")
def search(model):
    return Search(model=model, gait=load_gait(RABBIT / "gaits" / "paper-polished.toml", model))


@pytest.fixture(scope="module")
def found(search):
    return answer(Question(axis="push-back", intervals=(10,), starts=1), search)


def test_a_push_twice_what_a_tracker_holds_is_survivable_but_not_three_times(found):
    assert -70.0 < found.value < -50.0 and not found.at_bound and "local optimum" in found.sure


def test_the_walk_found_obeys_the_model_and_its_bounds(found, model, search):
    gait = search.gait
    motion, _ = functions(model)
    for z, phase in zip(found.motion.points, found.phases, strict=True):
        push = found.motion.disturbance if phase.pushed else 0.0
        for k in range(phase.points):
            missing, force, _ = motion(*np.split(z[:15, k], 3), z[15:, k], push)
            assert np.abs(np.array(missing)).max() < 1e-3
            tangential, normal = np.array(force).ravel()
            assert normal > 10.0 - 1e-2 and abs(tangential) < 0.8 * normal + 1e-2
        assert (np.abs(z[15:]) <= model.torque_limits[:, None] + 1e-6).all() and np.abs(z[4]).max() <= 1.0 + 1e-6
    p, w, _, _ = state_at(found.motion, found.phases, sum(found.motion.times))
    assert np.allclose(p, H @ gait.q_minus, atol=1e-5) and np.allclose(w, H @ gait.dq_minus, atol=1e-4)


def test_steps_that_must_be_quick_hold_less(search):
    quick = answer(Question(axis="push-back", intervals=(10,), starts=1, longest=0.6), search)
    assert -52.0 < quick.value < -40.0


@pytest.mark.parametrize(
    ("question", "low", "high"),
    [
        (Question(axis="push-back", seconds=0.5, intervals=(8,), starts=1), -110.0, -55.0),
        (Question(axis="impulse-forward", intervals=(8,), starts=1), 8.0, 80.0),
        (Question(axis="slope-up", intervals=(10,), starts=1), np.arctan(0.75), np.arctan(0.9)),
        (Question(axis="step-down", step=2, intervals=(8,), starts=1), -0.45, -0.1),
        (Question(axis="friction", intervals=(8,), starts=1), 0.0, 0.3),
    ],
    ids=lambda value: value.axis if isinstance(value, Question) else "",
)
def test_every_kind_of_disturbance_has_a_limit(question, low, high, search):
    found = answer(question, search)
    assert low < found.value < high
    assert found.at_bound == (question.axis == "friction")  # a walk that needs none: the program's own least is reached


def test_what_is_known_late_is_held_less(found):
    late = ask(Question(axis="push-back", intervals=(10,), starts=1, blind=0.1, controller="zd-pd"), "rabbit", GAIT)
    assert 0.6 < late.value / found.value < 0.95 and late.fit < 0.1


def test_a_file_of_limits_comes_back_and_knows_its_axes(tmp_path, found):
    path = tmp_path / "limits.toml"
    row = found.record()
    Limits(walker="w", gait="g", rows=()).with_row(row).with_row(row).write(path)
    limits = read_limits(path)
    assert len(limits.rows) == 1 and limits.rows[0]["value"] == row["value"]
    assert limits.row_of(found.question.key()) == limits.rows[0] and limits.row_of(Question(axis="load").key()) is None
    pushed = with_values(Scenario(), {"pushes": [{"force": -1.0, "step": 1}]})
    assert limits.beside(pushed, "pushes.0.force", -1) == limits.rows[0]
    assert limits.beside(pushed, "pushes.0.force", 1) is None
    doubted = dataclasses.replace(found, meshes={8: found.value, 16: 0.8 * found.value}, value=0.8 * found.value)
    assert found.trusted and not doubted.trusted and doubted.sure.startswith("not to be trusted: ")
    assert limits.with_row(doubted.record()).beside(pushed, "pushes.0.force", -1) is None
    whole = path.read_text()
    for line, other, said in (
        (f"value = {row['value']}", "value = nan", "value = nan: must be finite"),
        (f"value = {row['value']}", "value = 60", "value = 60 N: must be 0 or below"),
        ("unit = ", "other = ", "unit = None: must be text"),
        ('unit = "N"', 'unit = "kg"', "unit = 'kg': must be 'N' for push-back"),
        ("words = ", "other = ", "words = None: must be text"),
        ("\nstep = 1", "\nstep = true", "step = True: must be a whole number"),
        ("trusted = true", "trusted = 3", "trusted = 3: must be true or false"),
        ('axis = "push-back"', 'axis = "push-up"', "axis = 'push-up': must be one of push-back, "),
        ("words = ", "meshes = [[10, inf]]\nwords = ", "meshes = .*: must be finite numbers and text"),
        ("words = ", "when = 2020-01-01\nwords = ", "when = .*: must be finite numbers and text"),
    ):
        lines = [x for x in whole.splitlines() if not (x.startswith("meshes") and "meshes" in other)]
        path.write_text("\n".join(lines).replace(line, other))
        with pytest.raises(UserError, match=r"limits\.0\." + said):
            read_limits(path)
    path.write_text("walker = 1")
    with pytest.raises(UserError, match="made by cmpc limit --out"):
        read_limits(path)


def test_the_shipped_limits_stand_beside_the_atlas():
    """Of RABBIT as it is; a push through step 2 is held against step 1's, and what is not trusted against nothing."""
    limits, plan = shipped_limits("rabbit"), load_plan("atlas")
    assert plan.limits == "rabbit" and {row["axis"] for row in limits.rows} == {*AXES}
    assert limits.walker == fingerprint("rabbit", limits.gait)
    pushed = with_values(Scenario(), {"pushes": [{"force": -1.0, "step": 2}]})
    row = limits.beside(pushed, "pushes.0.force", -1)
    assert row is not None and row["step"] == 1 and row["value"] == pytest.approx(-59.8, abs=0.1)
    assert limits.beside(Scenario(), "plant.ground.friction", -1) is None
    assert limits.beside(Scenario(), "plant.mass_factor.torso", 1) is None


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("", "an AXIS is one of push-back"),
        ("push-up", "push-up: is no axis of cmpc limit"),
        ("push-back --step 4", "--step 4: must be from 1 to --steps, 3"),
        ("slope-up --for 1", "slope-up has no duration"),
        ("slope-up --step 2", "--step 2: says which step is pushed, or lands behind the ledge; slope-up has none"),
        ("push-back --blind 0.1 --step 2", "needs a push through step 1"),
        ("push-back --walker nowhere", "nowhere"),
        ("slope-up --log x.mcap", "walks one push or impulse"),
        ("push-back --out no/where.toml", "is no folder"),
        ("push-back --intervals 2", "--intervals"),
        ("push-back --intervals 101", "from 4 to 100"),
        ("push-back --starts 1000", "from 1 to 100"),
        ("push-back --steps 1000", "--steps 1000: must be from 1 to 12"),
        ("--all --step 2", "left out of --all"),
        ("--all --blind 0.1", "left out of --all"),
        ("push-back --controller nosuch", "--controller nosuch, --blind 0 s"),
        ("push-back --controller nosuch --blind 0.1", "controller.kind = 'nosuch'"),
    ],
)
def test_a_bad_question_is_one_line(words, said, capsys):
    assert cli.main(["limit", *words.split(), "--quiet"]) == 2
    err = capsys.readouterr().err
    assert said in err and err.count("\n") == 1


def test_a_row_of_other_meshes_or_fewer_guesses_is_asked_for_again():
    question = Question(axis="load", intervals=(8, 12), starts=2)
    row = {"intervals": [8, 12], "starts": ["2.1", "none"]}
    assert question.searched_as(row) and question.searched_as({"meshes": [[8, 2.0], [12, 2.1]], "starts": ["2", "2"]})
    assert not question.searched_as(row | {"intervals": [8]}) and not question.searched_as(row | {"starts": ["2.1"]})


@pytest.mark.parametrize("line", ["intervals = 5", "meshes = 3", "meshes = [8, 12]", "meshes = [[8]]", "starts = 3"])
def test_a_row_that_says_no_meshes_or_guesses_is_asked_for_again(line, found, tmp_path, monkeypatch, capsys):
    key, _, value = line.partition(" = ")
    row = found.record()
    del row["intervals"]  # without them the meshes count
    row[key] = json.loads(value)
    path, asked = tmp_path / "limits.toml", []
    Limits(walker=fingerprint("rabbit", GAIT), gait=GAIT, rows=(row,)).write(path)
    assert f"\n{line}\n" in path.read_text()
    monkeypatch.setattr("sim.bridge.limits.ask", lambda question, *_, **__: asked.append(question.axis) or found)
    words = ["limit", "--all", "--quiet", "--intervals", *map(str, found.question.intervals), "--starts", "1"]
    assert cli.main([*words, "--gait", GAIT, "--out", str(path)]) == 0, capsys.readouterr().err
    assert "push-back" in asked


def test_python_asks_as_the_command_does():
    least = sim.limit("friction", intervals=(8,), starts=1)
    assert least.question.step == 1 and 0.0 < least.value < 0.3 and least.question.what.unit == "ratio"


@pytest.mark.parametrize(
    ("axis", "keywords", "said"),
    [
        ("push-up", {}, "push-up: is no axis"),
        ("push-back", {"step": 0}, "--step 0: must be from 1 to --steps, 3"),
        ("push-back", {"height": 1.0}, "limit: height: unknown; must be of axis"),
        ("push-back", {"friction": float("nan")}, "--friction nan"),
        ("push-back", {"seconds": float("nan")}, "--for nan s"),
        ("push-back", {"intervals": ()}, "--intervals"),
        ("push-back", {"starts": 0}, "--starts 0"),
        ("push-back", {"blind": 0.1}, "--controller none, --blind 0.1 s"),
    ],
)
def test_python_refuses_a_bad_question(axis, keywords, said):
    with pytest.raises(UserError, match=said):
        sim.limit(axis, **keywords)


@pytest.mark.parametrize(
    ("broken", "said"),
    [
        ("", "is missing; must"),
        ("raise OSError('no GLIBC')", "does not work (no GLIBC)"),
        ("x = 1", "does not work (mod"),
    ],
)
def test_without_casadi_it_says_what_to_install(broken, said, tmp_path):
    (tmp_path / "casadi.py").write_text(broken)
    words = (
        f"import sys; sys.path.insert(0, {str(tmp_path)!r}); "
        if broken
        else "import sys; sys.modules['casadi'] = None; "
    )
    code = words + "from sim import cli; sys.exit(cli.main(['limit', 'push-back', '--quiet']))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT)
    (line,) = spoken(done.stderr)
    assert done.returncode == 2 and "pip install 'cmpc-walker[design]'" in line and said in line


def test_a_device_is_written_into_not_read(found, monkeypatch, capsys):
    """A full one takes nothing away: the answer is told first."""
    monkeypatch.setattr("sim.bridge.limits.ask", lambda *_, **__: found)
    assert cli.main(["limit", "push-back", "--quiet", "--out", "/dev/null"]) == 0
    assert cli.main(["limit", "push-back", "--quiet", "--out", "/dev/full"]) == 2
    out, err = capsys.readouterr()
    assert out.count("backward through step 1: -6") == 2 and "/dev/full: cannot be written" in err


@pytest.mark.parametrize("name", AXES)
def test_the_axes_of_a_file_are_those_that_may_be_asked(name, tmp_path):
    """With their units and signs."""
    limits, path = shipped_limits("rabbit"), tmp_path / "limits.toml"
    row = next(row for row in limits.rows if row["axis"] == name)
    dataclasses.replace(limits, rows=(row,)).write(path)
    assert read_limits(path).rows == (row,)
    for change in ({"value": -row["value"]}, {"unit": "kg"}, {"axis": f"{name}s"}):
        dataclasses.replace(limits, rows=({**row, **change},)).write(path)
        with pytest.raises(UserError, match=f"{next(iter(change))} = "):
            read_limits(path)


PLAN = """
limits = "limits.toml"
controllers = ["zd-pd"]
scenario.steps = 1
scenario.plant.kind = "rigid"
margin = [{axes = [{paths = ["plant.mass_factor.torso"], nominal = 1.0, low = 1.0, high = 1.1, tolerance = 0.1}]}]
"""


def report(out):
    with open_results(out) as results:
        return write_report(results, out)


def test_limits_of_a_plan_are_of_its_walker_and_results_outlive_their_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    limits, plan, out = tmp_path / "limits.toml", tmp_path / "plan.toml", tmp_path / "out"
    limits.write_text((ROOT / "sim/trials/plan/shipped/limits/rabbit.toml").read_text())
    plan.write_text(PLAN)
    held = dataclasses.replace(load_plan(str(plan)), seed=2)
    monkeypatch.chdir(ROOT)
    results = run_plan(held, out, workers=1)
    assert results.plan.limits == str(limits)
    results.store.close()
    page = report(out)
    assert "gait paper-polished" in page.read_text()
    limits.write_text(limits.read_text().replace("7e087c2218d9", "elsewhere"))
    with pytest.raises(
        UserError, match=r"limits\.toml': are of walker elsewhere; must be of the plan's, 'rabbit' \(7e0"
    ):
        run_plan(held)
    limits.unlink()
    with pytest.raises(UserError, match=r"limits\.toml: no file of limits that can be read"):
        load_plan(str(plan))
    results = run_plan(dataclasses.replace(held, limits="rabbit"), out, workers=1)  # no other plan
    results.store.close()
    assert "No limits are drawn" in report(out).read_text()
