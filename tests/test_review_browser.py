"""The review page in a browser: every key and control, links, print, export, two runs on one axis, accessibility."""

import csv
import io
import json
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from sim.log.read import read_log
from sim.review import load
from tests.browser import Browser
from tests.test_review_page import boxes, ink, logs, pages  # noqa: F401

AXE = Path(__file__).resolve().parent / "node/node_modules/axe-core/axe.min.js"
KEYS = (
    "b",
    "p",
    "d",
    "r",
    "f",
    "l",
    "a",
    "a",
    "a",
    "[",
    "]",
    "+",
    "-",
    ",",
    ".",
    "Home",
    "End",
    "ArrowLeft",
    "ArrowRight",
)


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    pytest.importorskip("PIL")
    with Browser(tmp_path_factory.mktemp("profile"), 1400, 900) as found:
        yield found


def blank(browser):
    """Plots with less ink than their axes' numbers have, by name."""
    browser.resize()
    browser.run("cmpc.redraw()")
    picture = browser.screenshot()
    plots = boxes(browser, "#bands .plot canvas:first-child, #plots .plot canvas:first-child")
    browser.resize(900)
    return [name for name, box in plots.items() if ink(picture, box) < 60]


@pytest.mark.parametrize("which", [0, 1])
def test_no_key_and_no_control_breaks_a_page(browser, pages, which):  # noqa: F811
    browser.complaints.clear()
    browser.open(pages[which], "#theme=light")
    for key in KEYS:
        browser.press(key)
    browser.press("?", text="?")
    assert browser.run("document.getElementById('keys').open")
    browser.run("document.querySelector('#keys form button').click()")
    assert blank(browser) == []
    names = "downloads"
    browser.run(
        f"window.{names} = [], download = (name, content) => {names}.push([name, content.size ?? content.length])"
    )
    controls, asked = browser.run(
        "(async () => { let n = 0, asked = 0; for (const one of document.querySelectorAll('main button'))"
        " if (!one.hidden) { one.click(); one.click(); n++; if (one.closest('.save')) asked += 2; }"
        " for (const one of document.querySelectorAll('main select')) for (const way of one.options)"
        " { one.value = way.value; one.dispatchEvent(new Event('change')); n++; }"
        " document.querySelectorAll('.moment').forEach(row => row.click());"
        f" for (let i = 0; i < 400 && {names}.length < asked; i++) await new Promise(done => setTimeout(done, 50));"
        " return [n, asked]; })()"
    )
    assert controls > 100 and browser.complaints == []
    saved = browser.run(names)
    assert len(saved) == asked > 60 and min(size for _, size in saved) > 10
    assert {name.rpartition(".")[2] for name, _ in saved} == {"svg", "png", "csv"}
    browser.run("cmpc.play(false), document.querySelectorAll('.legend .off').forEach(one => one.click())")
    browser.run("document.getElementById('mode').hidden || cmpc.setMode('overlay')")
    assert blank(browser) == [] and browser.complaints == []


def test_a_link_leads_to_its_moment_and_view(browser, pages):  # noqa: F811
    browser.open(pages[1], "#theme=light")
    browser.run("cmpc.setAlign('step'), cmpc.zoom(0.2, 0.5), cmpc.seek(0.321)")
    address = browser.run("new Promise(done => setTimeout(() => done(location.hash), 400))")
    assert "t=0.321" in address and address == browser.run("cmpc.address()")
    browser.open(pages[1], address)
    told = browser.run("[cmpc.t, cmpc.view.from, cmpc.view.to, cmpc.align]")
    assert told[:3] == pytest.approx([0.321, 0.2, 0.5], abs=1e-3) and told[3] == "step"
    browser.run("location.hash = '#t=0.4'")
    assert browser.run("new Promise(done => setTimeout(() => done(cmpc.t), 100))") == pytest.approx(0.4)


def test_the_page_says_what_it_thins(browser, pages):  # noqa: F811
    browser.open(pages[0], "#theme=light")
    assert "every tick is drawn" in browser.run("cmpc.zoom(0.2, 0.25), document.getElementById('scale').textContent")
    code = "cmpc.runs[0].ticks *= 2, cmpc.plots.forEach(one => { if (one.inner) one.inner.w = 10; }), cmpc.zoom(0, 1)"
    browser.run(code)
    browser.run("cmpc.plots.forEach(one => { if (one.inner) one.inner.w = 10; }), cmpc.tellScale()")
    told = browser.run("document.getElementById('scale').textContent")
    assert "ticks a pixel, drawn from least to largest" in told and "the page keeps" in told


def test_a_printed_page_has_the_ink_of_the_screen(browser, pages, tmp_path):  # noqa: F811
    """Chromium prints from the media "print" what the page prepared before; each plot is there, in light colours."""
    browser.open(pages[0], "#theme=light&t=0.3")
    browser.run("cmpc.t = -1, cmpc.point()")
    browser.resize()
    on_screen, places = browser.screenshot(), boxes(browser, ".plot canvas:first-child")
    browser.run("document.documentElement.dataset.theme = 'dark'")
    browser.call("Emulation.setEmulatedMedia", media="print")
    browser.run("window.dispatchEvent(new Event('beforeprint'))")
    browser.resize()
    assert browser.run("document.documentElement.dataset.theme") == "light"
    on_paper, sheets = browser.screenshot(tmp_path / "paper.png"), boxes(browser, ".sheet svg")
    assert sheets.keys() == places.keys()
    for name, (x, y, w, h) in sheets.items():
        title = 40 * w / places[name][2]  # a sheet has title and names in it
        share = (w * (h - title)) ** 0.5 / (places[name][2] * places[name][3]) ** 0.5
        there, here = ink(on_paper, (x, y + title, w, h - title)), ink(on_screen, places[name])
        assert 0.4 * share < there / here < 2.5 * share, (name, there, here)
    pdf = browser.call("Page.printToPDF", printBackground=True)["data"]
    assert len(pdf) > 100_000
    browser.run("window.dispatchEvent(new Event('afterprint'))")
    browser.call("Emulation.setEmulatedMedia", media="")
    assert browser.run("document.querySelectorAll('.sheet').length") == 0


def test_exports_hold_what_is_shown(browser, pages, logs):  # noqa: F811
    browser.open(pages[0], "#theme=light")
    browser.run("cmpc.zoom(0.2, 0.25)")
    plot = "cmpc.plots.find(one => one.panel.name === 'torque-left_hip')"
    rows = list(csv.reader(io.StringIO(browser.run(f"csvOf({plot})"))))
    assert rows[0] == ["t [s]", "ZD+PD [N·m]", "MPC [N·m]", "applied [N·m]"] and len(rows) == 52
    control = read_log(logs[0]).channel("/control")
    assert [float(row[1]) for row in rows[1:]] == pytest.approx(control["u_zd.left_hip"][200:251].tolist(), rel=1e-4)
    svg = ElementTree.fromstring(browser.run(f"svgOf({plot})"))
    paths = [one for one in svg.iter() if one.tag.endswith("path") and len(one.get("d", "")) > 200]
    assert len(paths) >= 2 and svg[0].text == "Torque, left hip"
    told = browser.run(
        "lines([...document.querySelector('#steps table').rows].map(r => [...r.cells].map(c => c.textContent)))"
    )
    assert len(list(csv.reader(io.StringIO(told)))) == 1 + len([e for e in load(logs[0]).events if e.name == "impact"])


def test_two_runs_are_aligned_by_step_and_by_clock(browser, pages, logs):  # noqa: F811
    browser.open(pages[1], "#theme=light")
    first, second = ([e.t for e in load(path).events if e.name == "impact"] for path in logs)
    for way in ("step", "clock"):
        browser.run(f"cmpc.setAlign('{way}')")
        both = min(len(first), len(second))
        assert [browser.run(f"cmpc.onAxis(1, {t})") for t in second[:both]] == pytest.approx(first[:both], abs=2e-3)
        assert browser.run("cmpc.ofRun(1, cmpc.onAxis(1, 0.3))") == pytest.approx(0.3, abs=1e-3)
        assert browser.run("Array.from(cmpc.runs[1].source.t).every((t, i, all) => !i || t >= all[i - 1])")
    # one clock: the gap in s is small by the clock and not by the time
    gap = (
        "Math.max(...Array.from(gap.columns.s).filter((v, i) => i < 400 && Number.isFinite(v)"
        " && cmpc.runs[1].source.columns.s[i] > 0.15 && cmpc.runs[1].source.columns.s[i] < 0.9).map(Math.abs))"
    )
    assert browser.run(gap) < 0.01
    browser.run("cmpc.setAlign('time')")
    assert browser.run("cmpc.onAxis(1, 0.3)") == pytest.approx(0.3)


def test_bands_and_steps_lead_to_their_moment(browser, pages, logs):  # noqa: F811
    browser.open(pages[0], "#theme=light")
    impacts = [e.t for e in load(logs[0]).events if e.name == "impact"]
    browser.run("document.querySelectorAll('#steps .jump')[1].click()")
    assert browser.run("cmpc.t") == pytest.approx(impacts[0], abs=2e-3)
    assert browser.run("document.querySelector('[aria-current]').cells[0].textContent") == "2"
    browser.run("cmpc.seek(0.1)")
    assert "push" in browser.run("document.querySelector('#plot-bands .legend').textContent")


@pytest.mark.skipif(not AXE.exists(), reason="axe-core is missing: npm ci --prefix tests/node")
@pytest.mark.parametrize("which", [0, 1])
@pytest.mark.parametrize("theme", ["light", "dark"])
def test_axe_finds_nothing_serious(browser, pages, which, theme):  # noqa: F811
    browser.open(pages[which], f"#theme={theme}")
    browser.run(AXE.read_text() + "; 0")
    found = browser.run(
        "axe.run(document, {resultTypes: ['violations']}).then(r => r.violations.map(v => [v.impact, v.id,"
        " v.nodes.slice(0, 3).map(n => n.html.slice(0, 120))]))"
    )
    assert [one for one in found if one[0] in ("serious", "critical")] == [], json.dumps(found)


def test_the_walker_is_large(browser, pages):  # noqa: F811
    browser.resize(900)
    browser.open(pages[0], "#theme=light&t=0.3")
    x, y, w, h = next(iter(boxes(browser, "#figure").values()))
    picture = browser.screenshot()[round(y) : round(y + h), round(x) : round(x + w)].astype(int)
    drawn = np.argwhere(np.abs(picture - picture[5, 5]).max(axis=2) > 120)
    tall = np.ptp(drawn[:, 0])
    assert tall > 330 and tall > 0.6 * h
