"""What a page says first of a fall is what made it: falls whose cause, and whose moment, are known by construction."""

import dataclasses
import json
import re

import pytest
from test_trials_cause import CONSTRUCTED, DT, END, LIMIT, symptoms, walk

from sim.bridge.run import known_belief, run_scenario
from sim.interface import JOINTS
from sim.log.read import read_log
from sim.log.write import Recorder
from sim.review.page import page
from sim.scenario import load, with_values
from sim.trials.falls.cause import Cause
from tests.browser import Browser
from tests.test_recorder import HEADER, SUMMARY

ONSETS = (0.65, 0.75, 0.85)  # [s]; the run ends at `END`
MADE = [(cause, began) for began in ONSETS for cause in symptoms(began)]
"""24 falls: each symptom at three moments."""
NEAR = 0.05  # [s]


def fallen(path, cause, began):
    """A log of a made-up walk that falls of a cause from a moment on."""
    with Recorder(path, HEADER, DT) as recorder:
        walk(symptoms(began)[cause], tape=recorder)
        limits = dict.fromkeys(JOINTS, LIMIT)
        reason = "the hip sank below the fall height"
        made = {"outcome": "fell", "fall_reason": reason, "torque_limit_Nm": limits, "steps": 1, "time_s": END}
        recorder.result(dataclasses.replace(SUMMARY, **made))
    return path


def first_words(path):
    """Answer and moment that its page tells, and the page."""
    text = page([read_log(path)])
    run = json.loads(re.search(r'<script id="data" type="application/json">(.*?)</script>', text, re.S)[1])["runs"][0]
    return run["head"]["answer"], run["began"], text


@pytest.mark.parametrize("cause", [Cause.SLIP, Cause.TORQUE, Cause.STALL])
def test_a_page_names_cause_and_moment(tmp_path, cause):
    answer, began, _ = first_words(fallen(tmp_path / "run.mcap", cause, 0.8))
    assert cause.value in answer and began == pytest.approx(0.8, abs=NEAR)


@pytest.mark.campaign
def test_24_made_up_falls_are_named_on_the_first_screen(tmp_path, capsys):
    """At least 22 with the right cause and an onset within 50 ms, in the uppermost 200 pixels of the page."""
    right, worst = 0, 0.0
    with Browser(tmp_path / "profile", 1280, 720) as browser:
        for number, (cause, when) in enumerate(MADE):
            answer, began, text = first_words(fallen(tmp_path / f"{number}.mcap", cause, when))
            (tmp_path / f"{number}.html").write_text(text)
            browser.open(tmp_path / f"{number}.html")
            shown, bottom, cursor = browser.run(
                "(e => [e.textContent, e.getBoundingClientRect().bottom, cmpc.t])(document.querySelector('.answer'))"
            )
            assert shown == answer and bottom < 200 and cursor == pytest.approx(began)
            good = cause.value in shown and abs(cursor - when) <= NEAR
            right, worst = right + good, max(worst, abs(cursor - when) if good else 0.0)
    with capsys.disabled():
        print(f"\n{right} of {len(MADE)} made-up falls named, onset within {1e3 * worst:.0f} ms")
    assert len(MADE) == 24 and right >= 22


@pytest.mark.campaign
def test_falls_of_the_campaigns_are_named_on_the_page(tmp_path, capsys):
    """At least 22 in 24 of the falls that were made by faults of plant, sensors and motors."""
    wrong = []
    for number, (kind, changes, word) in enumerate(CONSTRUCTED):
        scenario = with_values(load("undisturbed"), {"controller.kind": kind, "steps": 12} | changes)
        path = tmp_path / f"{number}.mcap"
        run_scenario(scenario, log=path, belief=known_belief(scenario.walker, scenario.gait))
        answer, _, _ = first_words(path)
        if not re.match(rf"fell in step \d+: from [\d.]+ s {word}: ", answer):
            wrong.append((kind, changes, word, answer))
    with capsys.disabled():
        print(f"\n{len(CONSTRUCTED) - len(wrong)} of {len(CONSTRUCTED)} constructed falls named; others: {wrong}")
    assert len(wrong) <= len(CONSTRUCTED) * 2 / 24
