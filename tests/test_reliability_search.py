"""Searches by yes and no on limit states with known answers; `make reliability-proof` is the long version."""

import dataclasses
import math
from statistics import NormalDist

import limit_states
import numpy as np
import pytest

from sim.trials.reliability import directional as directions
from sim.trials.reliability.asking import DECIMALS, answer, ask, together
from sim.trials.reliability.certificate import Certificate, Verdict
from sim.trials.reliability.differences import beta_difference, paired, probability_difference
from sim.trials.reliability.draws import draw, normal_draws
from sim.trials.reliability.nearest import Mode, nearest
from sim.trials.reliability.probability import OWN, Sample, estimate, importance, interval, plain
from sim.trials.reliability.sensitivity import halving, sobol_of_margin
from sim.trials.reliability.subset import subset
from tests.reliability_proof import MOST, searched

STATES = {state.name: state for state in limit_states.all_limit_states()}


@pytest.mark.parametrize("name", ["linear, 2", "linear, 20", "parabolic, 5", "island, 2", "two-sided, 5"])
def test_the_nearest_fall_is_within_two_percent_and_the_probability_near(name):
    state = STATES[name]
    for seed in (0, 1):
        one = searched(state, seed)
        assert abs(one.found.beta / state.beta - 1.0) < 0.02
        # five times the coefficient of variation asked for
        assert abs(one.found.probability.value / state.probability - 1.0) < 1.0
        assert one.calls < 0.1 / (state.probability * 0.2**2) or state.probability > 5e-3


def test_intervals_of_importance_sampling_cover_the_truth():
    state = STATES["four branches, 2"]
    assert sum(searched(state, seed).covers(state.probability) for seed in range(20)) >= 18


@pytest.mark.parametrize("method", ["subset", "directional", "crude"])
def test_every_method_covers_the_truth_and_stays_within_the_walks_it_is_given(method):
    covered = 0
    for state in (STATES["linear, 10"], STATES["island, 2"], STATES["two-sided, 5"]):
        for seed in range(3):
            one = searched(state, seed, method)
            covered += one.covers(state.probability)
            assert one.found.probability.method == method and one.more <= MOST[method] + 1500  # with a pilot
    assert covered >= 8


def test_directions_are_drawn_with_the_density_that_their_weights_say():
    mode = Mode(inside=np.array([2.8, 0.0, 0.0]), outside=np.array([2.0, 2.0, 1.0]))
    ways = directions._ways(3, (mode,), np.random.default_rng(0), 40_000)
    ratio = directions._ratio(ways, (mode,))
    even = [ratio.mean(), (ratio * ways[:, 0]).mean(), (ratio * ways[:, 1] ** 2).mean()]
    assert even == pytest.approx([1.0, 0.0, 1.0 / 3.0], abs=0.05)  # moments of even directions on a sphere
    assert ratio.max() <= 1.0 / OWN


def test_a_margin_that_says_nothing_leaves_subset_simulation_with_plain_draws():
    state = STATES["two-sided, 2"]
    for margin in (None, lambda u: np.zeros(len(u))):
        sample, calls = answer(subset(2, np.random.default_rng(0), variation=0.2, most=2000), state.falls, margin)
        assert calls == 100 + len(sample.u) and np.ptp(sample.weight) == 0.0
        assert estimate(sample).low <= state.probability <= estimate(sample).high


def test_differences_on_the_same_draws_hold_the_truth():
    one, other = limit_states.linear(3, 2.2), limit_states.linear(3, 2.5)
    for seed in range(6):
        a, b = (searched(state, seed).found for state in (one, other))
        _, low, high = beta_difference(a.nearest, b.nearest)
        assert low <= 0.3 <= high and high - low < 0.12
        value, low, high = probability_difference((a.probability, a.sample), (b.probability, b.sample))
        assert low <= other.probability - one.probability <= high and value < 0.0
    none = dataclasses.replace(a.nearest, modes=())
    assert beta_difference(none, none)[0] == 0.0 and beta_difference(a.nearest, none)[0] == np.inf
    assert paired(np.zeros(50)) == (0.0, pytest.approx(-0.0533, abs=1e-3), pytest.approx(0.0533, abs=1e-3))


def test_every_mode_is_found_and_each_is_a_walk_just_inside_a_fall():
    state = STATES["four branches, 2"]
    draws, _ = answer(draw(2, np.random.SeedSequence(3), 200, 40, (0.5, 0.7, 1.4, 2.0)), state.falls)
    found, _ = answer(nearest(draws.u, draws.fell, np.random.default_rng(3)), state.falls)
    assert len(found.modes) == 4 and found.looked == 60 and found.fell == 0
    for mode in found.modes:
        assert state.falls(mode.outside[None])[0] and not state.falls(mode.inside[None])[0]
        assert np.linalg.norm(mode.inside) == pytest.approx(mode.beta, rel=0.006)


def test_a_walk_that_falls_undisturbed_and_one_that_never_falls_are_said_as_such():
    always, never = (lambda u: np.ones(len(u), dtype=bool)), (lambda u: np.zeros(len(u), dtype=bool))
    for falls, modes in ((always, 1), (never, 0)):
        draws, _ = answer(draw(3, np.random.SeedSequence(0), 50, 10, (2.0,)), falls)
        found, _ = answer(nearest(draws.u, draws.fell, np.random.default_rng(0)), falls)
        assert len(found.modes) == modes and not any(mode.beta for mode in found.modes)
    assert estimate(plain(draws)).value == 0.0 and 0.0 < estimate(plain(draws)).high < 0.1


def test_a_search_is_the_same_whatever_the_batches_are_run_with():
    state = STATES["island, 2"]
    first, second = (searched(state, 5) for _ in range(2))
    assert first.calls == second.calls and first.found.probability == second.found.probability
    few, more = normal_draws(4, np.random.SeedSequence(1), 0, 5), normal_draws(4, np.random.SeedSequence(1), 0, 9)
    assert (few == more[:5]).all()
    assert (ask([[0.123456789]]).u == np.round(0.123456789, DECIMALS)).all()


def test_searches_in_step_get_their_own_answers():
    def one(value: float):
        fell = yield ask([[value], [-value]])
        again = yield ask([[2 * value]])
        return [*fell.tolist(), *again.tolist()]

    found, asked = answer(together([one(1.0), one(-3.0)]), lambda u: u[:, 0] > 0)
    assert found == [[1.0, 0.0, 1.0], [0.0, 1.0, 0.0]] and asked == 6


def test_weights_are_unbiased_whatever_the_modes_are():
    state = STATES["two-sided, 5"]
    draws, _ = answer(draw(5, np.random.SeedSequence(1), 200, 40, (2.0,)), state.falls)
    found, _ = answer(nearest(draws.u, draws.fell, np.random.default_rng(1)), state.falls)
    rng = np.random.default_rng(8)
    for modes in ((), found.modes[:1], found.modes):
        sample, _ = answer(importance(5, modes, rng, variation=0.004, most=20_000), state.falls)
        assert np.mean(sample.weight) == pytest.approx(1.0, abs=0.1)
        assert np.mean(sample.weight * sample.fell) == pytest.approx(state.probability, rel=0.3)


def test_an_interval_of_a_halved_spread_covers_the_truth_and_is_narrower_than_falls_alone_give():
    state, axis, seeds = limit_states.linear(5, 0.5), 0, 400
    part = float(limit_states._way(5)[axis])
    share = NormalDist().cdf
    truth = share(-0.5 / math.sqrt(1.0 - 0.75 * part**2)) - share(-0.5)
    covered, ratios = 0, []
    for seed in range(seeds):
        u = np.random.default_rng(seed).normal(size=(150, 5))
        fell = state.falls(u).astype(float)
        _, low, high = halving(Sample(u=u, fell=fell, weight=np.ones(150), method="crude"), axis)
        covered += low <= truth <= high
        alone = fell * (2.0 * np.exp(-1.5 * u[:, axis] ** 2) - 1.0)
        ratios.append((high - low) / (2.0 * 1.976 * alone.std(ddof=1) / math.sqrt(150)))
    assert covered >= 0.93 * seeds and np.mean(ratios) < 0.9


def test_an_interval_of_nothing_is_wide():
    assert interval(np.zeros(0)) == (0.0, 1.0) and interval(np.zeros(300)) == (0.0, 0.01)


def test_a_certificate_is_right_as_often_as_it_says():
    test = Certificate(probability=0.02, confidence=0.9)
    for truth, wrong in ((0.02, (Verdict.CERTIFIED,)), (0.04, (Verdict.CERTIFIED,)), (0.01, (Verdict.REFUSED,))):
        errors = 0
        for seed in range(100):
            falls = np.cumsum(np.random.default_rng(seed).random(2000) < truth)
            ends = (test.verdict(int(falls[k]), k + 1 - int(falls[k])) for k in range(19, 2000, 20))
            errors += next((end for end in ends if end is not Verdict.OPEN), Verdict.OPEN) in wrong
        assert errors <= 17  # 10 expected at most; more than 17 have a chance below 0.01


def test_a_certificate_takes_little_more_than_the_fewest_walks_there_are():
    test = Certificate(probability=1e-3, confidence=0.95)
    assert 2995 <= test.least <= 3400  # 2995: ln(0.05) / ln(1 - 1e-3), for one look alone
    assert test.verdict(0, test.least - 1) is Verdict.OPEN and test.verdict(30, 500) is Verdict.REFUSED


def test_indices_of_a_margin_are_those_of_a_surface_that_is_known():
    u = np.random.default_rng(0).normal(size=(150, 6))
    found = sobol_of_margin(u, 2.0 + u[:, 1] + 0.5 * u[:, 1] * u[:, 4])  # variances 1 and 0.25
    assert found.accuracy > 0.9 and found.first[1] == pytest.approx(0.8, abs=0.05)
    assert found.first[4] < 0.05 and found.total[4] == pytest.approx(0.2, abs=0.06)
    assert found.total[[0, 2, 3, 5]].max() < 0.03 and sobol_of_margin(u, np.ones(150)) is None
    assert sobol_of_margin(u, np.random.default_rng(1).normal(size=150)).accuracy < 0.2
