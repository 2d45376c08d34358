"""Studies of the nearest fall in plans: spaces, courses that go on, pages, and the walks run again."""

import dataclasses
import json
from argparse import Namespace

import numpy as np
import pytest

from sim.commands import campaign as campaigns
from sim.commands import nearest
from sim.errors import UserError
from sim.review.campaign import review_campaign
from sim.scenario import Scenario
from sim.trials.plan.plan import from_toml, load_plan
from sim.trials.report.reliability_checks import crude_checks, repeats
from sim.trials.report.reliability_findings import certificates, reliability_findings
from sim.trials.report.reliability_section import beta_words
from sim.trials.report.reliability_tables import errors, percent, probable, quantity, signed
from sim.trials.report.report import write_report
from sim.trials.report.reviews import beside_of, log_of, review_of
from sim.trials.report.summary import summarise
from sim.trials.run import workers as pools
from sim.trials.run.campaign import Results, _run, run_plan
from sim.trials.run.recall import open_results, stored_scenario
from sim.trials.run.replay import Replays
from sim.trials.run.result import TrialResult
from sim.trials.run.store import Store

pytest.importorskip("openturns")

from sim.trials.reliability.space import Space

AXES = """
[[reliability.axes]]
name = "push"
paths = ["pushes.0.force"]
also = ["pushes.0.step = 2"]
distribution = "normal"
centre = 0.0
spread = 8.0
[[reliability.axes]]
name = "damping"
paths = ["plant.damping_factor.left_hip"]
distribution = "log-normal"
centre = 1.0
spread = 0.2
[[reliability.axes]]
name = "friction"
paths = ["plant.ground.friction"]
distribution = "uniform"
low = 0.3
high = 0.9
[[reliability.axes]]
name = "latency"
paths = ["actuation.latency"]
distribution = "choice"
values = [0, 1, 2]
[[reliability.axes]]
name = "bias"
paths = ["sensors.torso_bias"]
distribution = "normal"
centre = 0.0
spread = 0.01
low = -0.01
high = 0.02
"""
STUDY = """
[[reliability]]
name = "near"
draws = 60
rays = 15
look = 10
most = 150
pairs = ["push, bias"]
"""
ONE = "[[reliability.axes]]" + AXES.split("[[reliability.axes]]")[1]
PLAN = 'controllers = ["zd-pd", "c-mpc"]\n' + STUDY + AXES


def fake(hard: dict[str, float], order: int = 1, most: int = 10**9):
    """Workers that answer at once: a walk falls when push and damping together are too much for its controller."""
    left = [most]

    def execute(trials, stop):
        for trial in list(trials)[::order]:
            if not left[0]:
                return
            left[0] -= 1
            controller, index, point = trial
            push, damping = float(point.values[0]) / 8.0, np.log(float(point.values[1])) / 0.2
            fell = bool(0.8 * push - 0.6 * damping > hard[controller])
            values = json.dumps(
                dict(zip(("push", "damping", "friction", "latency", "bias"), point.values, strict=True))
            )
            yield (
                TrialResult(controller=controller, trial=index, study="near", values=values, seed=point.seed,
                            outcome="fell" if fell else "completed", survived=not fell,
                            evidence=json.dumps({"least_speed_m_s": 0.5 - 0.1 * (0.8 * push - 0.6 * damping)})),
                "{}",
            )  # fmt: skip

    return execute


@pytest.fixture(scope="module")
def results():
    """The plan's, run to the end."""
    return ran(from_toml(PLAN))


def never() -> None:
    """No reason to stop."""


HARD = {"zd-pd": 1.5, "c-mpc": 2.8}


def ran(plan, **given) -> Results:
    return _run(plan, Store(None, write=True), fake(HARD, **given), None, never)


def test_coordinates_are_the_distributions_quantiles():
    space = Space(from_toml(PLAN).reliability[0], Scenario())
    push, damping, friction, latency, bias = space.values(np.array([1.0, -2.0, 0.0, 0.0, 0.0]))
    assert (push, friction, latency) == (8.0, 0.6, 1)
    assert damping == pytest.approx(np.exp(-0.4)) and -0.01 < bias < 0.01
    assert space.values(np.full(5, 8.0))[3:] == (2, pytest.approx(0.02))
    u = np.array([0.7, -1.3, 0.4, 0.0, 1.1])
    assert space.normal(space.values(u)) == pytest.approx(u, abs=1e-6)


def test_correlated_axes_are_correlated_as_asked():
    plan = from_toml(PLAN.replace('pairs = ["push, bias"]', 'correlations = ["push, damping = -0.7"]'))
    space = Space(plan.reliability[0], Scenario())
    u = np.random.default_rng(0).normal(size=(2000, 5))
    values = np.array([space.values(point)[:2] for point in u], dtype=float)
    assert np.corrcoef(values[:, 0], np.log(values[:, 1]))[0, 1] == pytest.approx(-0.7, abs=0.03)


LOOK = "look = 10"
BAD = {
    "[[reliability]]": "has no axes",
    STUDY.replace('pairs = ["push, bias"]', "") + ONE.replace("8.0", "0.0"): "none of its axes is random",
    PLAN.replace("push, bias", "push, slope"): "two of push; damping",
    PLAN.replace("draws = 60", "draws = 2"): "draws = 2",
    PLAN.replace(LOOK, 'correlations = ["push, bias = 2"]'): "-1 < value < 1",
    PLAN.replace(LOOK, 'correlations = ["push, push = 0.5"]'): "two of push",
    PLAN.replace(
        LOOK, 'correlations = ["push, damping = 0.9", "push, friction = 0.9", "damping, friction = -0.9"]'
    ): "positive definite",
    PLAN.replace(LOOK, "scales = [1.0]"): "scales = [1.0]",
    PLAN.replace('distribution = "uniform"\nlow = 0.3', 'distribution = "uniform"\nlow = -0.3'): "friction",
    PLAN.replace("low = -0.01", "low = 0.03"): "below high",
    PLAN.replace("sensors.torso_bias", "sensors.torso_base"): "'near': sensors.torso_base: no such setting",
}


@pytest.mark.parametrize("text", BAD)
def test_plans_that_are_not_legal_are_refused_in_a_line(text):
    with pytest.raises(UserError) as error:
        from_toml(text)
    assert BAD[text] in str(error.value) and "\n" not in str(error.value)


def test_the_course_is_the_same_in_any_order_and_after_any_stop(results):
    plan = from_toml(PLAN)
    reference = list(results)
    assert list(ran(plan, order=-1)) == reference
    little = dataclasses.replace(plan.reliability[0], search=1)
    assert len(list(ran(dataclasses.replace(plan, reliability=(little,))))) < len(reference)
    store = Store(None, write=True)
    for most in (1, 7, 90, 130, 10**9):
        execute = fake(HARD, most=most)
        stopped = iter([None, "stop"]) if most < 10**9 else iter([None] * 1000)
        results = _run(plan, store, execute, None, lambda stopped=stopped: next(stopped, "stop"))
    assert list(results) == reference and not results.interrupted


@pytest.mark.parametrize("method", ["subset", "directional", "crude"])
def test_each_way_to_a_probability_goes_on_after_any_stop(method):
    plan = from_toml(PLAN.replace('"zd-pd", ', "").replace("most = 150", f'most = 600\nprobability = "{method}"'))
    reference = list(ran(plan))
    store = Store(None, write=True)
    for most in (1, 400, 10**9):
        stopped = iter([None, "stop"]) if most < 10**9 else iter([None] * 1000)
        results = _run(plan, store, fake(HARD, most=most), None, lambda stopped=stopped: next(stopped, "stop"))
    assert list(results) == reference
    (mpc,) = reliability_findings(results, plan.reliability[0]).each
    p = mpc.found.probability
    assert p.method == method and p.low <= 0.00256 <= p.high
    assert {"subset": "subset simulation", "directional": "directional sampling", "crude": "draws"}[
        method
    ] in summarise(results)


def test_a_study_says_how_far_what_of_and_how_probable(results, tmp_path):
    found = reliability_findings(results, results.plan.reliability[0])
    pd, mpc = found.each
    assert pd.found.beta == pytest.approx(1.5, rel=0.02) and mpc.found.beta == pytest.approx(2.8, rel=0.03)
    for one, truth in ((pd, 0.0668), (mpc, 0.00256)):
        assert one.found.probability.low <= truth <= one.found.probability.high
        side = one.sides[0]
        assert side.importance[:2] == pytest.approx([0.64, 0.36], abs=0.12)
        assert side.outside.fell and side.inside.survived
    (against,) = found.against
    assert against.beta_interval[0] <= against.beta <= against.beta_interval[1]
    assert against.probability_interval[0] < -0.01 < against.probability_interval[1] + 0.2
    assert pd.margin.accuracy > 0.9 and pd.margin.total[:2] == pytest.approx([0.64, 0.36], abs=0.1)
    assert pd.changes[0][0] < 0.0 > pd.changes[1][0]
    page = write_report(results, tmp_path).read_text()
    assert "deviations" in page and f"Trial that falls: zd-pd/{pd.sides[0].outside.trial}; that walks" in page
    assert f"push {pd.sides[0].values[0]:.4g} N ({pd.sides[0].mode.outside[0]:+.2f})" in page
    assert "reduce first: push (" in page and "0 of 10 means that at most 26 % of directions" in page
    assert "share of falls is no probability" in page and "axis by axis" not in page
    assert "share of falls is no probability" in (tmp_path / "breaks.html").read_text()
    assert "near: zd-pd: nearest fall at 1.5" in summarise(results)


def test_a_page_says_what_one_deviation_is_in_the_units_of_the_machine():
    correlated = PLAN.replace('pairs = ["push, bias"]', 'correlations = ["push, damping = -0.7"]')
    for text in (PLAN, correlated):
        rows = errors(Space(from_toml(text).reliability[0], Scenario()))
        assert rows[:2] == [("push", "0", "8", "N"), ("damping", "1", "1.221", "")] and rows[3][1:] == (
            "1",
            "2",
            "ticks",
        )
    assert [quantity(1.0, "ticks"), quantity(2.0, "ticks"), quantity(0.997, "ratio")] == ["1 tick", "2 ticks", "0.997"]
    assert [signed(0.0), signed(0.4), signed(-0.00087)] == ["0", "+0.400", "-0.00087"] and percent(0.972) == "97 %"
    assert [probable(p) for p in (0.0, 0.4, 0.00123, 1.0)] == ["0", "0.40", "0.0012", "1"]


def test_a_search_that_ended_before_the_falls_it_saw_does_not_say_that_nothing_fell(tmp_path):
    short = ran(from_toml(PLAN.replace(LOOK, "look = 10\nsearch = 1")))
    pd, mpc = reliability_findings(short, short.plan.reliability[0]).each
    assert beta_words(pd) == "not found in 1 walks of the search" and not mpc.sides
    page = write_report(short, tmp_path).read_text()
    assert f"that fall within {short.plan.scenario.steps} steps" in page and "<h3>The nearest falls</h3>" not in page


def test_plain_draws_find_no_fall_that_is_nearer_and_as_many_as_the_study_says(results):
    plan = from_toml(PLAN)
    found = reliability_findings(results, results.plan.reliability[0])
    crude = dataclasses.replace(plan.reliability[0], draws=1500, rays=0, scales=(), modes=0, pairs=())
    plain = ran(dataclasses.replace(plan, seed=5, reliability=(crude,)))
    pd, mpc = crude_checks(found, plain, crude)
    assert pd.draws == 1500 and pd.falls == pytest.approx(0.0668 * 1500, rel=0.25) and not pd.nearer
    assert pd.beta <= pd.nearest and plain.store.result("zd-pd", int(pd.trial.split("/")[1])).fell
    assert "never farther" in pd.lines[0] and "inside its interval, the two agree" in pd.lines[1]
    farther = dataclasses.replace(mpc, beta=mpc.nearest + 0.1, nearer=1, probability=(0.5, 0.4, 0.6))
    assert "FARTHER than 1 of" in farther.lines[0] and "outside its interval, the two do not agree" in farther.lines[1]


def test_a_study_repeated_under_other_seeds_says_how_far_its_distances_spread(results):
    plans = [from_toml("seed = " + str(seed) + "\n" + PLAN) for seed in (1, 2)]
    found = [reliability_findings(one, one.plan.reliability[0]) for one in (results, *map(ran, plans))]
    pd, mpc = repeats((0, 1, 2), found)
    assert (pd.controller, mpc.controller) == ("zd-pd", "c-mpc") and pd.spread < 0.03 and len(set(pd.betas)) == 3
    three = dataclasses.replace(pd, betas=(1.9, 2.0, 2.1))
    assert (three.mean, three.spread, three.deviation) == pytest.approx((2.0, 0.1, 0.05))
    assert "10.0 % of the mean, standard deviation 5.0 %" in three.lines[0] and len(three.lines) == 5


def test_both_checks_run_what_is_missing_and_print_a_line_each(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(pools, "local", lambda campaign, workers: fake(HARD))
    monkeypatch.setattr(campaigns, "write_pages", lambda results, out: None)
    plan = from_toml(PLAN.replace('"zd-pd", ', "").replace("draws = 60", "draws = 20"))
    found = Namespace(
        workers=1, cluster=None, mix=True, quiet=True, controllers="c-mpc", repeat=2, check_crude=30
    )  # fmt: skip
    assert nearest.repeat(plan, tmp_path, found) == 0
    assert "2 seeds, each with its own noise" in capsys.readouterr().out and (tmp_path / "seed-1").is_dir()
    assert nearest.check_crude(plan, tmp_path / "seed-0", found) == 0
    before = (tmp_path / "seed-0" / "results.sqlite").stat().st_mtime_ns
    assert nearest.check_crude(plan, tmp_path / "seed-0", found) == 0
    assert (tmp_path / "seed-0" / "results.sqlite").stat().st_mtime_ns == before  # the study was there
    said = capsys.readouterr().out
    assert "falls among 30 draws" in said and (tmp_path / "seed-0" / "crude-30-c-mpc" / "results.sqlite").is_file()
    with pytest.raises(UserError, match=r"has no \[\[reliability"):
        nearest.repeat(load_plan("montecarlo"), tmp_path, found)
    with pytest.raises(UserError, match=r"--check-crude 20001: .*must be 10 to 20000"):
        nearest.check_crude(plan, tmp_path / "never", Namespace(check_crude=20001))
    (tmp_path / "other").mkdir()
    with Store(tmp_path / "other" / "results.sqlite", write=True) as store:
        store.set_plan(load_plan("montecarlo"))
    with pytest.raises(UserError, match="holds results of a plan that differs"):
        nearest.check_crude(plan, tmp_path / "other", found)


def test_pairs_of_axes_can_be_added_to_a_study_that_is_over(tmp_path, monkeypatch):
    monkeypatch.setattr(pools, "local", lambda campaign, workers: fake(HARD))
    plan = from_toml(PLAN)
    before = list(first := run_plan(plan, tmp_path, mix=True))
    first.store.close()
    more = nearest.with_pairs(plan, "push, damping; push, bias", tmp_path)
    assert more.reliability[0].pairs == ("push, bias", "push, damping")
    for again in (more, plan):  # the second asks for nothing, and forgets nothing
        results = run_plan(again, tmp_path, mix=True)
        assert results.plan == more
        after = list(results)
        assert set(before) < set(after)
        results.store.close()
    there = open_results(tmp_path)
    _, plane = reliability_findings(there, there.plan.reliability[0]).each[0].found.planes
    away = 2.0 * np.pi * 15 / 16  # between the two axes, where pushes and little damping add up
    assert plane[0] == pytest.approx(1.5 / 0.8, rel=0.02)
    assert plane[15] == pytest.approx(1.5 / (0.8 * np.cos(away) - 0.6 * np.sin(away)), rel=0.02)
    assert nearest.with_pairs(plan, "bias, push; bias, push", tmp_path / "no").reliability[0].pairs[1:] == (
        "bias, push",
    )
    with pytest.raises(UserError, match="--pairs ' ; ': names no pair"):
        nearest.with_pairs(plan, " ; ", tmp_path)
    other = dataclasses.replace(more, reliability=(dataclasses.replace(more.reliability[0], pairs=()),), seed=3)
    with pytest.raises(UserError, match="seed"):
        run_plan(other, tmp_path)


def test_rows_of_another_search_are_refused(results):
    other = dataclasses.replace(results.plan, seed=9)
    with pytest.raises(UserError, match="not what the search asks for"):
        Replays(other, results.store).replay(other.reliability[0], 0, "zd-pd")


def test_a_certificate_is_said_refused_or_left_open():
    text = PLAN.replace("[[reliability", "[[certificate").replace('pairs = ["push, bias"]', "probability = 0.02")
    for line in ("draws = 60\n", "rays = 15\n", "look = 10\n"):
        text = text.replace(line, "")
    plan = from_toml(text.replace("most = 150", "most = 800"))
    results = ran(plan)
    said = {name: one.verdict.value for name, one in certificates(results, plan.certificate[0]).items()}
    assert said == {"zd-pd": "refused", "c-mpc": "certified"}
    short = dataclasses.replace(plan, certificate=(dataclasses.replace(plan.certificate[0], most=60),))
    assert "neither can be said" in summarise(ran(short))


def test_the_walk_just_inside_walks_again_and_the_fall_falls_again(tmp_path):
    plan = from_toml(
        'controllers = ["zd-pd"]\n[scenario]\nsteps = 2\n[[reliability]]\ndraws = 10\nrays = 0\nlook = 1\nmost = 1\n'
        + ONE.replace("8.0", "60.0")
    )
    results = run_plan(plan, tmp_path, workers=1)
    (found,) = reliability_findings(results, plan.reliability[0]).each
    side = found.sides[0]
    told = []
    review_campaign(results, tmp_path, 1, told.append, lambda: None)
    assert told[-1] == "1 of 1 nearest falls fall again, and the walk just inside each walks"
    page = (tmp_path / "report.html").read_text()
    for link in (review_of(side.inside), review_of(side.outside), beside_of(side.inside, side.outside)):
        assert f'href="{link}"' in page and (tmp_path / link).is_file()
    assert f"cmpc video {tmp_path / log_of(side.inside)} {tmp_path / log_of(side.outside)}" in page
    results.store.close()
    for trial in (side.inside, side.outside):
        scenario = stored_scenario(f"{tmp_path}#zd-pd/{trial.trial}")
        assert scenario.pushes[0].force == trial.axis_values["push"] and scenario.seed == trial.seed
    assert side.inside.survived and side.outside.fell
    with pytest.raises(UserError, match="asks as it learns"):
        stored_scenario(f"{tmp_path}#zd-pd/150000")
