"""A campaign opened from its page: its falls run again, drawn, each with its review, beside the nearest survivor."""

import re
import shutil

import pytest

from sim.cli import main
from sim.review import load
from sim.trials.plan.plan import from_toml
from sim.trials.run import run_plan

PLAN = """
name = "small"
seed = 11
controllers = ["zd-pd"]

[scenario]
steps = 1

[[grid]]
[[grid.axes]]
paths = ["start.torso_lean"]
low = 0.0
high = 0.9
count = 3
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("campaign") / "results"
    run_plan(from_toml(PLAN), folder, workers=1).store.close()
    return folder


def test_falls_have_their_reviews(folder, capsys):
    assert main(["review", str(folder), "--no-open"]) == 0
    assert capsys.readouterr().out.strip() == str(folder / "falls.html")
    text, report = (folder / "falls.html").read_text(), (folder / "report.html").read_text()
    pages = re.findall(r'<a href="(reviews/zd-pd-\d+\.html)"', text)
    assert pages and all((folder / page).exists() for page in pages)
    for page in pages:
        assert load((folder / page).with_suffix(".mcap")).result["outcome"] == "fell"
        assert f'<a href="{page}">' in report
    assert text.count("<polyline") == len(pages) * 6 * 3 and 'href="falls.html"' in report
    beside = re.search(r'href="(reviews/zd-pd-1-beside-zd-pd-2\.html)"', text)
    assert beside and (folder / beside[1]).exists()


def test_a_log_that_was_cut_short_is_not_taken_for_the_run(folder, tmp_path, capsys):
    again = shutil.copytree(folder, tmp_path / "again", ignore=shutil.ignore_patterns("reviews"))
    (again / "reviews").mkdir()
    (again / "reviews" / "zd-pd-2.mcap.partial").write_bytes(b"cut")
    assert main(["review", str(again), "--no-open"]) == 0
    assert not list((again / "reviews").glob("*.partial"))
    assert all(load(path).result["outcome"] for path in (again / "reviews").glob("*.mcap"))


def test_what_has_been_run_again_stays(folder, capsys):
    main(["review", str(folder), "--no-open"])
    times = {path: path.stat().st_mtime_ns for path in (folder / "reviews").iterdir()}
    assert main(["review", str(folder), "--no-open", "--most", "1"]) == 0
    assert {path: path.stat().st_mtime_ns for path in (folder / "reviews").iterdir()} == times
    assert (folder / "falls.html").read_text().count('aria-label="zd-pd/') == 1


def test_bad_input_is_one_line(folder, tmp_path, capsys):
    for words in ([tmp_path], [folder, folder]):
        assert main(["review", *map(str, words), "--no-open"]) == 2
        assert capsys.readouterr().err.count("\n") == 1
