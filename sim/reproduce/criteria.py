"""When a claim of the paper holds: one rule for each of its words, the same for every figure.

The paper gives figures and words and no thresholds. Each word has one rule here; numbers are the issue's where a
tolerance is asked for ("within 5 %"), and else one number alone, a tenth. The rules were fixed before the results
they judge were computed; what was changed after them is listed in `CHANGED`. A claim that fails is reported as failing.
"""

import math
from dataclasses import dataclass

from sim.loop import Outcome

TENTH = 0.1
"""What is small beside something: at most this share of it."""

ROUNDING = 1e-3
"""Relative; what a limit may be passed by without counting, as solver and log do not carry more digits."""

GAIT_TOLERANCE = 0.05
"""Relative: step length and time of the gait "within 5 %"."""

NOMINAL_TOLERANCE, DOUBLED_TOLERANCE = 0.02, 0.1
"""Absolute, of the eigenvalues 0.75 and 0.78 on the paper's plant."""

INCLINE = math.radians(1.0)
"""[rad] The least slope that is called an inclination; the paper gives none."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Rule:
    """A rule in words, for the page.

    Attributes:
        words: What the claims say.
        meaning: When that holds.
        used: The experiments that use it.
    """

    words: str
    meaning: str
    used: str


RULES = (
    Rule(
        words="almost zero, vanishes, no remaining error, reduces again",
        meaning=f"at most {TENTH:g} of what it is compared with",
        used="fig5, fig6",
    ),
    Rule(
        words="larger, smaller, more",
        meaning="ratio above 1, below 1; by how much is shown, not judged",
        used="fig4, fig5, fig8, incline, noise",
    ),
    Rule(
        words="never above, within the limits",
        meaning=f"the largest value is at most the limit, but for {ROUNDING:g} of it (rounding)",
        used="fig4, fig7",
    ),
    Rule(words="above the limit", meaning="the largest value is above it by more than that", used="fig7"),
    Rule(
        words="no drastic change",
        meaning=f"worse by at most {TENTH:g} of the value it is compared with",
        used="horizon",
    ),
    Rule(
        words="the paper's value",
        meaning=f"within {GAIT_TOLERANCE:.0%} (gait), {NOMINAL_TOLERANCE:g} and {DOUBLED_TOLERANCE:g} (eigenvalues, on "
        f"the paper's plant), {TENTH:.0%} (anything else)",
        used="fig3, fig4, table2",
    ),
    Rule(
        words="stable",
        meaning="the undisturbed walk does not fall and the largest |eigenvalue| is below 1; an eigenvalue counts "
        "if its noise floor is at most the tolerance above, or on MuJoCo at most its distance from 1",
        used="table2",
    ),
    Rule(
        words="walks on, falls",
        meaning="the judge of every run, over the whole run",
        used="fig4, fig5, table2, readings, incline",
    ),
    Rule(
        words="extended upward",
        meaning="the largest force survived is at no offset below ZD+PD's, and above it at one at least",
        used="fig8",
    ),
    Rule(
        words="navigates inclinations",
        meaning=f"survives {math.degrees(INCLINE):g} deg at every length tried",
        used="incline",
    ),
)
"""Every rule there is."""

CHANGED = (
    "The noise floor of an eigenvalue was a worst-case bound, under which C-MPC's would not have counted; it is the "
    "standard deviation over directions of perturbation since. Changed after results were seen.",
    "Shares of the torque leave out the 20 ms after impacts, as Fig. 7 does; with them they stand in brackets. Changed "
    "after results were seen.",
    "The friction rows are judged at the tick, where they act; the mean over the hold that follows stands beside it. "
    "Changed after results were seen.",
)
"""What was changed of the rules since they were fixed."""


def walks(outcome: int) -> bool:
    """Whether a run completed its steps; outcomes are numbered as `Outcome` lists them."""
    return tuple(Outcome)[outcome] is Outcome.COMPLETED


def negligible(value: float, beside: float) -> bool:
    """Whether a magnitude is small beside another."""
    return bool(value <= TENTH * beside)


def never_above(largest: float, limit: float) -> bool:
    """Whether a quantity whose largest value this is keeps a limit."""
    return bool(largest <= limit * (1.0 + ROUNDING))


def above(largest: float, limit: float) -> bool:
    """Whether it does not; False for NaN, of which nothing is known."""
    return bool(largest > limit * (1.0 + ROUNDING))


def near(value: float, paper: float) -> bool:
    """Whether a value is the paper's, where no tolerance is asked for."""
    return abs(value - paper) <= TENTH * abs(paper)


def no_worse(value: float, reference: float) -> bool:
    """Whether a value, the larger the better, is not drastically below the reference."""
    return bool(value >= (1.0 - TENTH) * reference)


def no_larger(value: float, reference: float) -> bool:
    """Whether a value, the smaller the better, is not drastically above the reference."""
    return bool(value <= (1.0 + TENTH) * reference)


def measured(noise_floor: float, tolerance: float) -> bool:
    """Whether a value is known well enough to be judged within a tolerance."""
    return bool(noise_floor <= tolerance)
