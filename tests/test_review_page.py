"""The review page: what is in it, and what a browser makes of it."""

import json
import re

import numpy as np
import pytest

from sim.bridge.run import run_scenario
from sim.cli import main
from sim.log.read import read_log
from sim.review import load
from sim.review.layouts import TABS, foxglove, plotjuggler, series_name
from sim.review.mechanics import mechanics_of
from sim.review.page import page
from sim.review.panels import PANELS
from sim.review.signals import Signals, decimated, signals_of
from sim.scenario import load as load_scenario
from sim.scenario import with_values
from tests.browser import Browser
from tests.log_mutations import Parts
from tests.test_logs import hostile

TWO_STEPS = {"steps": 2}


def run(path, name="push-40N-first", **changes):
    run_scenario(with_values(load_scenario(name), TWO_STEPS | changes), log=path)
    return path


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("page")
    return run(folder / "a.mcap"), run(folder / "b.mcap", **{"controller.kind": "zd-pd"})


@pytest.fixture(scope="module")
def pages(logs, tmp_path_factory):
    folder = tmp_path_factory.mktemp("html")
    one, two = folder / "one.html", folder / "two.html"
    assert main(["review", str(logs[0]), "--no-open", "--out", str(one)]) == 0
    assert main(["review", *map(str, logs), "--no-open", "--out", str(two)]) == 0
    return one, two


def test_a_log_of_a_newer_format_is_refused_in_one_line(logs, tmp_path, capsys):
    parts = Parts.of(logs[0].read_bytes())
    parts.said("run")["format"] = "99"
    newer = tmp_path / "newer.mcap"
    newer.write_bytes(parts.write())
    for paths in ([newer], [logs[1], newer]):
        assert main(["review", *map(str, paths), "--no-open", "--out", str(tmp_path / "page.html")]) == 2
        line = f"cmpc: error: {newer} is of log format 99; this program reads 1 to 2: a newer one is needed\n"
        assert capsys.readouterr().err == line
    assert not (tmp_path / "page.html").exists()


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    pytest.importorskip("PIL")
    with Browser(tmp_path_factory.mktemp("profile"), 1400, 900) as found:
        yield found


# What is in it


def data_of(text):
    return json.loads(re.search(r'<script id="data" type="application/json">(.*?)</script>', text, re.DOTALL)[1])


def test_the_page_fetches_nothing(pages):
    for path in pages:
        text = path.read_text()
        without_data = text.replace(re.search(r'<script id="data".*?</script>', text, re.DOTALL)[0], "")
        assert not re.findall(r"https?://|\bsrc=|@import|url\(", without_data)
        assert "default-src 'none'" in text


def test_words_of_a_log_stay_words(tmp_path, logs):
    """HTML and script ends in names, events and scenario."""
    evil = '</script><script>alert(1)</script><img src=x onerror="alert(2)"> & \u2028'
    scenario = with_values(
        load_scenario("undisturbed"), TWO_STEPS | {"name": evil, "description": evil, "time_limit": 0.05}
    )
    run_scenario(scenario, log=tmp_path / "evil.mcap")
    text = page([read_log(tmp_path / "evil.mcap")])
    assert text.count("<script") == 2 and text.count("</script>") == 2 and "<img" not in text
    assert data_of(text)["runs"][0]["head"]["name"].startswith("</script><script>alert(1)")


def test_signals_are_those_of_the_log(logs):
    log = read_log(logs[0])
    state, control = log.channel("/plant/state"), log.channel("/control")
    found = signals_of(load(logs[0]))
    assert found.columns["u_mpc.left_hip"].tolist() == control["u_mpc.left_hip"].tolist()
    assert found.columns["expected.normal"][1:].tolist() == control["contact_force.normal"][:-1].tolist()
    k = 100
    foot = ("left", "right")[control["stance"][k]]
    ratio = abs(state[f"contact_force.{foot}.tangential"][k]) / state[f"contact_force.{foot}.normal"][k]
    assert found.columns["ratio"][k] == pytest.approx(ratio)
    impact = int(found.impacts[0])
    seen = np.flatnonzero((control["impact_in"] > 0) & (control["_tick"] < impact))[-1]
    assert found.columns["impact_error"][seen] == pytest.approx(seen + control["impact_in"][seen] - impact)


def test_decimation_keeps_every_peak():
    rng = np.random.default_rng(0)
    values = rng.normal(size=10_007)
    values[[17, 5000, 10_006]] = 50.0, -70.0, 90.0
    values[300:400] = np.nan
    signals = Signals(
        tick=np.arange(10_007), t=np.arange(10_007) * 1e-3, columns={"x": values}, impacts=np.array([], int)
    )
    t, columns = decimated(signals, 1000)
    assert len(t) == len(columns["x"]) <= 1000 and (np.diff(t) >= 0).all()
    assert {50.0, -70.0, 90.0} <= set(columns["x"].tolist())
    assert t[np.nanargmax(columns["x"])] == pytest.approx(10.006, abs=0.03)


def test_every_panel_names_signals_that_exist(tmp_path):
    seen = load(run(tmp_path / "observed.mcap", **{"controller.observer.enabled": True}))
    columns = signals_of(seen).columns
    columns |= mechanics_of(seen, columns)
    assert {line.key for panel in PANELS for line in panel.lines} | {p.x for p in PANELS if p.x} <= set(columns)


def test_ten_seconds_make_less_than_five_megabytes(logs):
    """Scaled up from what one sample costs."""
    text = page([read_log(logs[0])])
    ticks = len(read_log(logs[0]).channel("/control"))
    assert ticks < 10_000 and len(text) / ticks * 10_000 < 5e6


def test_a_minute_is_there_tick_by_tick(browser, logs, tmp_path, monkeypatch):
    """Fewer samples than ticks would be said by their number; at the cursor stands the tick's own value."""
    path = run(tmp_path / "long.mcap", "undisturbed", steps=8)
    assert main(["review", str(path), "--no-open", "--out", str(tmp_path / "long.html")]) == 0
    control = read_log(path).channel("/control")
    browser.open(tmp_path / "long.html", "#theme=light")
    assert browser.run("cmpc.runs[0].source.t.length") == len(control)
    browser.run("cmpc.zoom(1.0, 1.05)")
    assert browser.run("Array.from(cmpc.runs[0].source.t).filter(t => t > 0.9999 && t < 1.0501).length") == 51
    told = browser.run("Array.from(cmpc.runs[0].source.columns['u_zd.left_knee'])")
    assert told == pytest.approx(control["u_zd.left_knee"].tolist(), rel=2e-5)


def test_a_cut_log_is_shown_and_the_page_says_so(logs, tmp_path, capsys):
    (tmp_path / "cut.mcap").write_bytes(logs[0].read_bytes()[:-9000])
    assert main(["review", str(tmp_path / "cut.mcap"), "--no-open"]) == 0
    assert "not finished" in data_of((tmp_path / "cut.html").read_text())["runs"][0]["head"]["damage"]


def test_a_log_without_ticks_is_refused(tmp_path, capsys):
    assert main(["review", str(hostile(tmp_path / "h.mcap")), "--no-open"]) == 2
    assert capsys.readouterr().err.count("\n") == 1


# What a browser makes of it


def ink(picture, box):
    """Pixels of a plot that stand out against its paper; grid lines do not."""
    x, y, w, h = (round(v) for v in box)
    part = picture[y + 6 : y + h - 18, x + 46 : x + w - 8].astype(int)
    paper = np.median(part.reshape(-1, 3), axis=0)
    return int((np.abs(part - paper).max(axis=2) > 60).sum())


def show_all(browser):
    """The whole page, its plots with nothing but grid and lines."""
    browser.run("document.getElementById('stage').style.position = 'static'")
    browser.run("cmpc.events = () => [], cmpc.spans = () => [], cmpc.limits = () => [], cmpc.t = -1")
    browser.resize()
    browser.run("cmpc.redraw()")


def boxes(browser, selector):
    code = (
        f"[...document.querySelectorAll({selector!r})].map(e => {{ const r = e.getBoundingClientRect();"
        " return [e.closest('article, section').id, r.x, r.y + scrollY, r.width, r.height]; })"
    )
    return {name: box for name, *box in browser.run(code)}


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_every_plot_is_drawn(browser, pages, tmp_path, theme):
    browser.complaints.clear()
    browser.requests.clear()
    browser.open(pages[0], f"#t=0.3&theme={theme}")
    show_all(browser)
    picture = browser.screenshot(tmp_path / "page.png")
    plots = boxes(browser, "#plots .plot canvas:first-child")
    assert len(plots) == len(data_of(pages[0].read_text())["panels"])
    empty = {name: ink(picture, box) for name, box in plots.items() if ink(picture, box) < 150}
    assert not empty
    assert ink(picture, next(iter(boxes(browser, "#figure").values()))) > 300
    assert ink(picture, boxes(browser, "#bands .plot canvas:first-child")["plot-bands"]) > 1000
    assert browser.complaints == []
    assert [url for url in browser.requests if not url.startswith(("file:", "data:"))] == []


def test_the_screenshot_test_can_fail(browser, pages):
    browser.open(pages[0], "#theme=light")
    browser.run("cmpc.runs[0].source.columns['speed'].fill(NaN)")
    show_all(browser)
    plots, picture = boxes(browser, ".plot canvas:first-child"), browser.screenshot()
    assert ink(picture, plots["plot-speed"]) == 0 and ink(picture, plots["plot-torso"]) > 150


def test_the_scrubber_moves_figure_and_cursors(browser, pages):
    browser.open(pages[0], "#theme=light")

    browser.resize()

    def look(t):
        browser.run(
            f"(s => {{ s.value = {t}; s.dispatchEvent(new Event('input')); }})(document.getElementById('scrub'))"
        )
        picture = browser.screenshot()
        parts = [
            next(iter(boxes(browser, "#figure").values())),
            boxes(browser, ".plot canvas:last-child")["plot-torque-left_hip"],
        ]
        cut = [picture[round(y) : round(y + h), round(x) : round(x + w)] for x, y, w, h in parts]
        return [*cut, browser.run("document.getElementById('clock').textContent"), browser.run("cmpc.t")]

    a, b = look(0.1), look(0.4)
    assert (b[2][:5], b[3]) == ("0.400", 0.4)
    assert (a[0] != b[0]).any(axis=2).sum() > 300, "the figure does not move"
    assert (a[1] != b[1]).any(axis=2).sum() > 50, "the cursor does not move"
    values = browser.run("[...document.querySelectorAll('#plot-torque-left_hip b')].map(e => e.textContent)")
    assert len(values) == 3 and all(value.endswith("N·m") for value in values)


def test_keys_zoom_hover_and_play(browser, pages, logs):
    browser.open(pages[0], "#theme=light")
    browser.resize(900)
    browser.press("ArrowRight")
    assert browser.run("cmpc.t") == pytest.approx(0.01)
    browser.press("]")
    impact = next(e.t for e in load(logs[0]).events if e.name == "impact")
    assert browser.run("cmpc.t") == pytest.approx(impact, abs=1e-6)
    browser.press("+")
    narrow = browser.run("cmpc.view.to - cmpc.view.from")
    assert narrow == pytest.approx(0.7 * browser.run("cmpc.end"))
    browser.press("r")
    x, y, w, h = browser.run(
        "(e => { e.scrollIntoView({block: 'center', behavior: 'instant'}); const r = e.getBoundingClientRect();"
        " return [r.x, r.y, r.width, r.height]; })(document.querySelector('#plots .plot'))"
    )
    browser.mouse("mouseMoved", x + w / 2, y + h / 2)
    assert browser.run("cmpc.hover") == pytest.approx(browser.run("cmpc.end") / 2, rel=0.15)
    browser.mouse("mousePressed", x + w / 2, y + h / 2, button="left", clickCount=1)
    browser.mouse("mouseMoved", x + w * 0.75, y + h / 2, button="left", buttons=1)
    browser.mouse("mouseReleased", x + w * 0.75, y + h / 2, button="left", clickCount=1)
    assert browser.run("cmpc.view.to - cmpc.view.from") < 0.4 * browser.run("cmpc.end")
    browser.press("Home")
    browser.press(" ", text=" ")
    assert browser.run("new Promise(done => setTimeout(() => done(cmpc.t), 300))") > 0.1
    browser.press(" ", text=" ")
    assert browser.run("cmpc.playing") is False


def test_two_logs_overlay_and_differ(browser, pages, logs):
    browser.complaints.clear()
    browser.open(pages[1], "#t=0.3&theme=dark")
    names = browser.run(
        "[...document.querySelectorAll('#plot-torso .legend button')].map(e => e.textContent.split(' ')[1])"
    )
    assert [name[0] for name in names] == ["A", "B"]
    browser.resize()
    browser.press("b")
    assert browser.run("cmpc.mode") == "difference"
    a, b = (read.channel("/plant/state") for read in map(read_log, logs))
    gap = float(b["q.torso"][300] - a["q.torso"][300])
    shown = browser.run("document.querySelector('#plot-torso b').textContent").replace("−", "-").removesuffix(" rad")
    assert float(shown) == pytest.approx(gap, rel=0.01)
    assert browser.complaints == []


def test_pushes_are_shaded(pages):
    spans = data_of(pages[0].read_text())["runs"][0]["spans"]
    assert [span["name"] for span in spans] == ["40 N"] and 0.0 <= spans[0]["from"] < spans[0]["to"]


def test_it_fits_a_phone(tmp_path, pages):
    pytest.importorskip("PIL")
    with Browser(tmp_path / "profile", 390, 844) as phone:
        phone.open(pages[1], "#t=0.3&theme=light")
        phone.screenshot(tmp_path / "phone.png")
        assert phone.run("document.documentElement.scrollWidth") <= 390
        small = phone.run(
            "[...document.querySelectorAll('button')].filter(e => e.closest('#tools, #transport') && e.offsetParent)"
            ".map(e => e.getBoundingClientRect().height)"
        )
        assert min(small) >= 26
        assert phone.complaints == []


# Layouts for other viewers


def paths():
    return [path for plots in TABS.values() for plot in plots for path in (*plot.curves, *([plot.x] if plot.x else []))]


def test_layouts_name_fields_that_are_logged(logs):
    log = read_log(logs[0])
    for path in paths():
        topic = max((t for t in log.channels if path.startswith(t + ".")), key=len)
        assert path[len(topic) + 1 :] in log.channel(topic).dtype.names, path


def test_foxglove_layout_is_whole():
    layout = json.loads(foxglove())

    def leaves(node):
        return [node] if isinstance(node, str) else leaves(node["first"]) + leaves(node["second"])

    tabs = layout["configById"]["Tab!plots"]["tabs"]
    used = leaves(layout["layout"]) + [leaf for tab in tabs for leaf in leaves(tab["layout"])]
    assert sorted(used) == sorted(layout["configById"])
    drawn = [p["value"] for c in layout["configById"].values() for p in c.get("paths", ())]
    assert set(paths()) - {"/control.theta"} <= set(drawn)


def test_plotjuggler_layout_has_every_curve(tmp_path, capsys):
    assert main(["review", "--layout", "plotjuggler", str(tmp_path / "walk.xml")]) == 0
    text = (tmp_path / "walk.xml").read_text()
    assert text == plotjuggler()
    assert all(f'"{series_name(path)}"' in text for path in paths())
    assert main(["review", "--layout", "plotjuggler", str(tmp_path / "walk.xml")]) == 2
