"""Studies without a walker: grids enumerate, margins bisect, draws have their distributions, statistics are right."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.scenario import Scenario
from sim.trials.plan import GridStudy, MarginStudy, MonteCarloStudy
from sim.trials.plan.grid import GridAxis, boundary
from sim.trials.plan.margin import Margin, MarginAxis, bracket, margin, next_positions
from sim.trials.plan.montecarlo import RandomAxis
from sim.trials.reliability.probability import wilson
from sim.trials.report import stats
from sim.trials.report.findings import Side, edge_words

SLOPE = ("plant.ground.slope",)


def axis(**values: object) -> MarginAxis:
    return MarginAxis(**{"paths": SLOPE, "nominal": 0.0, "low": -0.1, "high": 0.1, "tolerance": 0.001} | values)


def search(one: MarginAxis, side: int, survives) -> dict[int, bool]:
    """Run the search to its end, as a campaign does: what is next follows from what is known."""
    known: dict[int, bool] = {}
    while positions := next_positions(one, side, known):
        assert not set(positions) & set(known)
        known |= {position: survives(one.value(position)) for position in positions}
    return known


@given(edge=st.floats(0.0, 0.12), side=st.sampled_from([-1, 1]), scan=st.integers(1, 9))
def test_the_margin_is_the_last_lattice_value_before_the_edge(edge: float, side: int, scan: int) -> None:
    one = axis(scan=scan)
    known = search(one, side, lambda value: abs(value) <= edge)
    found = margin(one, side, {p: ["" if ok else "fell"] for p, ok in known.items()})
    assert found.value is not None and abs(found.value) <= edge + 1e-12
    if edge >= 0.1:
        assert found.fell_at is None and abs(found.value) == pytest.approx(0.1)
    else:
        assert found.fell_at is not None and abs(found.fell_at) > edge
        assert abs(found.fell_at - found.value) == pytest.approx(0.001)
    assert found.again == ()
    assert len(known) <= 1 + scan + math.ceil(math.log2(100)) + 1 + 2 * one.look


def test_survival_that_comes_back_is_found_and_said() -> None:
    one = axis(scan=5)
    known = search(one, 1, lambda value: value < 0.033 or value > 0.07)
    found = margin(one, 1, {p: ["" if ok else "tripped"] for p, ok in known.items()})
    assert found.value == pytest.approx(0.032) and found.fell_at == pytest.approx(0.033)
    assert found.again == pytest.approx((0.08, 0.1)) and found.reason == "tripped"


def test_a_walker_that_falls_at_the_nominal_value_has_no_margin() -> None:
    one = axis()
    known = search(one, 1, lambda value: value > 0.05)
    found = margin(one, 1, {p: ["" if ok else "fell"] for p, ok in known.items()})
    assert found.value is None and found.fell_at == 0.0 and found.again


@pytest.mark.parametrize(
    ("fell_at", "times"),
    [(0.004, 0.2), (-0.03, 1.5), (None, 5.0)],
)
def test_sides_compare_by_where_they_fall_in_typical_deviations(fell_at: float | None, times: float) -> None:
    """Where the first step of the lattice falls, the last value held is the nominal one and says nothing."""
    one = axis(typical=0.02)
    held = Margin(value=0.0, fell_at=fell_at, fell_position=None, reason="", again=(), trials=3)
    side = Side(axis=one, unit="rad", controller="c-mpc", sign=1, limit=0.1, margin=held, fall=None)
    assert side.typical_errors == pytest.approx(times)


def test_a_logarithmic_axis_is_even_in_ratio_and_meets_its_ends() -> None:
    one = axis(paths=("plant.ground.stiffness_factor",), nominal=1.0, low=0.01, high=10.0, tolerance=0.1, scale="log")
    low, high = one.ends
    assert one.value(0) == 1.0
    assert 0.01 <= one.value(low) < 0.011 and 9.0 < one.value(high) <= 10.0
    assert one.value(7) / one.value(6) == pytest.approx(1.1)


def test_an_axis_with_one_side_is_searched_on_that_side_alone() -> None:
    one = axis(low=0.0)
    assert next_positions(one, -1, {}) == [] and next_positions(one, 1, {})


def test_places_and_indices_are_inverse() -> None:
    study = MarginStudy(axes=(axis(low=-0.005), axis(low=0.0, high=0.003), axis(high=0.002)))
    places = [study.place(index) for index in range(study.size)]
    assert len(set(places)) == study.size
    for number in range(3):
        assert study.place(study.first_index(number)) == (number, 0)
    with pytest.raises(IndexError):
        study.place(study.size)


def test_bracket_looks_outwards_from_the_nominal_value() -> None:
    assert bracket(-1, {0: True, -4: True, -8: False, -9: True, 3: False}) == (-4, -8)


@given(st.lists(st.integers(1, 4), min_size=1, max_size=3))
def test_a_grid_has_every_combination_once_the_last_axis_fastest(counts: list[int]) -> None:
    study = GridStudy(axes=tuple(GridAxis(paths=SLOPE, low=0.0, high=1.0, count=n) for n in counts))
    points = [study.point(i) for i in range(study.size)]
    assert study.size == math.prod(counts) == len(set(points))
    assert points == sorted(points)


def test_boundary_is_the_stretch_around_the_start() -> None:
    alive = [True, False, True, True, True, False, True]
    assert boundary(tuple(map(float, range(7))), alive, 3) == (2, 4)
    assert boundary(tuple(map(float, range(7))), alive, 1) is None


def draws(n: int = 4000, whole: bool = False, **values: object) -> list:
    one = RandomAxis(paths=SLOPE, **values)
    generator = np.random.default_rng(0)
    return [one.draw(generator, whole=whole) for _ in range(n)]


def test_draws_have_their_distributions() -> None:
    normal = np.array(draws(distribution="normal", centre=2.0, spread=0.5))
    assert normal.mean() == pytest.approx(2.0, abs=0.03) and normal.std() == pytest.approx(0.5, rel=0.05)
    log = np.log(draws(distribution="log-normal", centre=3.0, spread=0.2))
    assert log.mean() == pytest.approx(math.log(3.0), abs=0.02) and log.std() == pytest.approx(0.2, rel=0.05)
    uniform = np.array(draws(distribution="uniform", low=-1.0, high=3.0))
    assert uniform.min() >= -1 and uniform.max() <= 3 and uniform.mean() == pytest.approx(1.0, abs=0.08)
    assert set(draws(distribution="choice", words=("a", "b"))) == {"a", "b"}
    assert set(draws(distribution="uniform", low=0, high=2, whole=True)) == {0.0, 1.0, 2.0}
    cut = np.array(draws(distribution="normal", centre=0.0, spread=1.0, low=0.0))
    assert cut.min() >= 0.0 and cut.mean() == pytest.approx(math.sqrt(2 / math.pi), abs=0.04)


def test_a_draw_depends_on_its_axis_and_not_on_those_beside_it() -> None:
    one, other, third = (
        RandomAxis(paths=SLOPE, name=name, distribution="uniform", low=0.0, high=1.0) for name in "abc"
    )
    few, more = MonteCarloStudy(axes=(one, other)), MonteCarloStudy(axes=(third, one, other))
    for number in range(20):
        assert few.draw(7, number, Scenario()) == more.draw(7, number, Scenario())[1:]
    drawn = [value for number in range(50) for value in more.draw(7, number, Scenario())]
    assert len(set(drawn)) == len(drawn)
    assert few.draw(8, 0, Scenario()) != few.draw(7, 0, Scenario())


@pytest.mark.parametrize(
    ("survived", "trials", "low", "high"),
    [(0, 10, 0.0, 0.2775), (10, 10, 0.7225, 1.0), (81, 263, 0.2553, 0.3662)],
)
def test_wilson_is_the_published_interval(survived: int, trials: int, low: float, high: float) -> None:
    """Last row: R. G. Newcombe, Statistics in Medicine 17 (1998), table I, method 3."""
    assert wilson(survived, trials) == pytest.approx((low, high), abs=1e-4)


@given(st.lists(st.tuples(st.booleans(), st.booleans()), max_size=60))
def test_mcnemar_is_the_binomial_test_of_the_discordant_pairs(pairs: list[tuple[bool, bool]]) -> None:
    found = stats.mcnemar(pairs)
    assert found.both + found.first + found.second + found.neither == len(pairs)
    differ = found.first + found.second
    tail = sum(math.comb(differ, k) for k in range(min(found.first, found.second) + 1))
    assert found.p == pytest.approx(min(1.0, 2 * tail / 2**differ))


def test_mcnemar_copes_with_ten_thousand_discordant_pairs() -> None:
    """By the normal approximation with continuity correction."""
    found = stats.mcnemar([(True, False)] * 5050 + [(False, True)] * 4950)
    assert found.p == pytest.approx(math.erfc((100 - 1) / 100 / math.sqrt(2)), rel=1e-3)


def test_holm_is_the_published_procedure() -> None:
    """S. Holm, Scandinavian Journal of Statistics 6 (1979): the smallest p times n, the next times n - 1, no less."""
    assert stats.holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert stats.holm([0.5, 0.6]) == [1.0, 1.0] and stats.holm([]) == []


def test_attribution_finds_the_axis_that_matters_and_tells_direction_from_distance() -> None:
    generator = np.random.default_rng(3)
    heavy, off, idle = generator.normal(size=(3, 600))
    survived = [bool(h < 0.6 and abs(o) < 1.2) for h, o in zip(heavy, off, strict=True)]
    found = {name: stats.attribute(name, list(x), survived) for name, x in zip("hoi", (heavy, off, idle), strict=True)}
    assert found["h"].value < -0.4 and abs(found["h"].value) > abs(found["h"].deviation)
    assert found["o"].deviation < -0.3 and abs(found["o"].value) < 0.2
    assert found["i"].strength < 0.12 < found["o"].strength
    assert stats.attribute("x", [1.0, 2.0, 3.0], [True, True, True]).strength == 0.0


def test_what_a_margin_holds_is_true_of_blurred_edges() -> None:
    """Fewer edges than `tests/margin_proof.py`, which asks for 99 % of 2,000."""
    from margin_proof import tally

    held, _, _ = tally(200, axis().look)
    assert held >= 198


def test_between_the_first_fall_and_the_last_survivor_is_the_mixed_part() -> None:
    one = axis(scan=1)
    mixed = {0.031: False, 0.034: False}
    known = search(one, 1, lambda value: mixed.get(round(value, 3), value < 0.0365))
    found = margin(one, 1, {p: ["" if ok else "fell"] for p, ok in known.items()})
    assert (found.value, found.fell_at, found.beyond) == pytest.approx((0.03, 0.031, 0.037))
    assert found.mixed == (4, 6) and found.again[-1] == pytest.approx(0.036)
    side = Side(axis=one, unit="rad", controller="c-mpc", sign=1, limit=0.1, margin=found, fall=None)
    assert "holds everything tried up to 0.03 rad; mixed from 0.031 to 0.036 rad (4 of 6 walk" in edge_words(side)
    assert "falls at all tried from 0.037 rad on" in edge_words(side)


def test_a_value_with_several_draws_is_held_where_all_walk() -> None:
    one = axis(high=0.003, low=0.0, look=0)
    found = margin(one, 1, {0: ["", ""], 1: ["", ""], 2: ["", "tripped"], 3: ["fell", "fell"]})
    assert (found.value, found.fell_at, found.beyond, found.reason) == (0.001, 0.002, 0.003, "tripped")
    assert found.mixed == (1, 2) and found.rates == ((0.0, 1.0), (0.001, 1.0), (0.002, 0.5), (0.003, 0.0))


def test_draws_of_a_margin_are_trials_of_their_own_and_the_first_is_undisturbed() -> None:
    from sim.trials.plan import Plan
    from sim.trials.run.trial import axis_values

    study = MarginStudy(axes=(axis(name="first", low=-0.005), axis(name="second", low=0.0, high=0.003)), draws=3)
    plan = Plan(margin=(study,))
    assert study.size == 3 * study.lattice
    zero = study.first_index(1)
    values = [axis_values(plan, zero + draw * study.lattice) for draw in range(3)]
    assert all(found[1] == {"second": 0.0} for found in values)
    assert "start.q_offset" not in values[0][2]
    offsets = [found[2]["start.q_offset"] for found in values[1:]]
    assert offsets[0] != offsets[1] and max(abs(x) for x in (*offsets[0], *offsets[1])) < 1e-3
