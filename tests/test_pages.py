"""What all pages share: escaping, data in scripts, pictures as SVG, and a browser's view of a reproduction."""

import dataclasses
import json
import re
from xml.etree import ElementTree

import numpy as np
import pytest

from sim import pages
from sim.pages.packing import packed
from sim.pages.picture import INK, picture
from sim.reproduce import report
from sim.reproduce.panels import Level, LinePanel, MapPanel, Series, Span
from sim.reproduce.study import Evaluation, Finding, Verdict
from tests.browser import Browser

EVIL = '</script><script>alert(1)</script><img src=x onerror="alert(2)"> & \u2028'


def drawn(words=EVIL):
    with picture(words, 200, 100) as made:
        made.title(made.axes.bar(0, 1)[0], words)
        made.axes.set_xlabel(words)
    return made.svg


def test_a_picture_is_sound_svg_whatever_its_words_are():
    root = ElementTree.fromstring(str(drawn()))
    assert root.tag.endswith("svg") and root.get("role") == "img"
    titles = [one.text for one in root.iter() if one.tag.endswith("title")]
    assert titles == [EVIL, EVIL]


def test_the_same_numbers_make_the_same_bytes_and_ink_follows_the_page():
    assert drawn() == drawn()
    assert INK not in drawn() and "currentColor" in drawn()


def test_names_inside_pictures_of_one_page_never_meet():
    names = [set(re.findall(r'id="([^"]+)"', drawn(words))) for words in "ab"]
    assert names[0] and not names[0] & names[1]


def finding():
    x = np.linspace(1.0, 10.0, 50)
    lines = LinePanel(
        title="lines",
        x_label="t [s]",
        y_label="y [rad]",
        series=(Series(name=EVIL, x=x, y=np.sin(x)), Series(name="b", x=x[::-1], y=x, dash="dashed", marker=True)),
        levels=(Level(y=0.5, name="limit"),),
        spans=(Span(x0=2.0, x1=3.0, name="push"),),
    )
    cells = np.arange(6).reshape(2, 3) % 2
    grid = MapPanel(
        title="map",
        x_label="a",
        y_label="b",
        x=np.arange(3.0),
        y=np.arange(2.0),
        classes=cells,
        names=("in", "out"),
        colours=("#dddddd", "#1f6fb2"),
    )
    panels = ((lines, dataclasses.replace(lines, log_x=True)), (dataclasses.replace(lines, equal=True), grid))
    verdict = Verdict(
        claim=EVIL, paper="1", rigid=Finding(text="1", holds=True), mujoco=Finding(text=EVIL, holds=False)
    )
    return Evaluation(panels=panels, verdicts=(verdict,), tables={"a": {"x": x}}, notes=(EVIL,))


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    folder = tmp_path_factory.mktemp("reproduction")
    report.write("fig3", finding(), folder, quick=True)
    return report.write_page({"fig3": finding()}, folder, quick=True)


def test_words_stay_words_in_text_and_in_scripts(page):
    text = page.read_text()
    assert "alert(1)" in text and "<script>alert" not in text and "<img src=x" not in text
    rows = json.loads(re.search(r'<script type="application/json"[^>]*>(.*?)</script>', text, re.DOTALL)[1])
    assert rows[0][0]["series"][0]["name"] == EVIL
    assert pages.number(0.123456) == "0.1235" and pages.number(3) == "3"


def test_a_browser_draws_every_panel_of_a_reproduction(page, tmp_path):
    pytest.importorskip("PIL")
    with Browser(tmp_path / "profile", 1200, 900) as browser:
        browser.open(page)
        browser.resize()
        shot = browser.screenshot(tmp_path / "page.png")
        places = browser.run(
            "[...document.querySelectorAll('.plot')].map(e => { const r = e.getBoundingClientRect();"
            " return [r.x, r.y + scrollY, r.width, r.height].map(Math.round); })"
        )
        assert len(places) == 4
        for x, y, w, h in places:
            part = shot[y : y + h, x : x + w].astype(int)
            assert (np.abs(part - np.median(part.reshape(-1, 3), axis=0)).max(axis=2) > 60).sum() > 300
        x, y, w, h = places[0]
        before = browser.run("drawn[0].view.to - drawn[0].view.from")
        browser.run(f"scrollTo(0, {y - 100})")
        top = y - browser.run("scrollY")
        for kind, at in (("mousePressed", 0.3), ("mouseMoved", 0.6), ("mouseReleased", 0.6)):
            browser.mouse(kind, x + at * w, top + h / 2, button="left", clickCount=1, buttons=1)
        assert browser.run("drawn[0].view.to - drawn[0].view.from") == pytest.approx(0.3 * before, rel=0.2)
        assert browser.complaints == []
        assert [url for url in browser.requests if not url.startswith(("file:", "data:"))] == []


def test_packed_numbers_are_right_to_their_digits_and_a_browser_reads_them(tmp_path):
    rng = np.random.default_rng(0)
    rows = np.vstack((np.cumsum(rng.normal(size=500)), 1e3 * rng.normal(size=500), np.zeros(500)))
    rows[0, 10:20], rows[1, 3] = np.nan, -1e30
    for bits, right in ((15, 2.0**-16), (22, 2.0**-23)):
        page = tmp_path / f"{bits}.html"
        script = pages.page._environment().from_string('<script>{{ asset("plot.js") }}</script>').render()
        page.write_text(f"{script}<script>document.documentElement.dataset.ready = 1</script>")
        with Browser(tmp_path / f"profile{bits}", 300, 200) as browser:
            browser.open(page)
            plain = "rows => rows.map(row => Array.from(row, v => isNaN(v) ? null : v))"
            code = f"unpacked({json.dumps(packed(rows, bits=bits))}).then({plain})"
            read = np.array(browser.run(code), dtype=float)
        assert (np.isnan(read) == np.isnan(rows)).all()
        assert np.nanmax(np.abs(read - rows) / np.maximum(np.abs(rows), 1e-30)) <= 1.01 * right + 2.0**-24
