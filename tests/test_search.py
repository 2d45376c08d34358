"""The search behind `cmpc gains` and `cmpc weights`: finds, resumes, refuses."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from sim.errors import UserError
from sim.search import Space, check_out, recorded, search

BOTTOM = np.array([100.0, 100.0, 15.0, 15.0])
SPACE = Space(start=(20.0,) * 4, low=(2.0,) * 4, high=(800.0,) * 4)


def bowl(point):
    """Least, 0, at `BOTTOM`."""
    return float(np.sum(np.log(np.array(point) / BOTTOM) ** 2))


def test_search_finds_the_bottom_of_a_bowl():
    best = search(bowl, SPACE, seed=0, evaluations=300)
    assert best.value < 0.05 and best.point == pytest.approx(BOTTOM, rel=0.2)


def test_the_start_comes_first_and_evaluations_are_as_many_as_asked():
    done = []
    search(bowl, SPACE, seed=0, evaluations=5, keep=done.append)
    assert done[0].point == SPACE.start and len(done) == 5


def test_an_interrupted_search_goes_on_as_if_it_had_not_been():
    whole, part, rest = [], [], []
    search(bowl, SPACE, seed=3, evaluations=60, keep=whole.append)
    search(bowl, SPACE, seed=3, evaluations=25, keep=part.append)
    search(bowl, SPACE, seed=3, evaluations=60, known=part[:17], keep=rest.append)
    assert part[:17] + rest == whole
    with pytest.raises(UserError, match="another point"):
        search(bowl, SPACE, seed=4, evaluations=60, known=part, keep=rest.append)


def test_a_record_is_gone_on_with_or_refused(tmp_path):
    record, lines, calls = tmp_path / "g.jsonl", [], []

    def evaluate(point):
        calls.append(point)
        return bowl(point)

    def go(evaluations, **changes):
        head = {"of": "a bowl"} | changes
        return recorded(
            evaluate, SPACE, record, head, seed=1, evaluations=evaluations, measure="depth", say=lines.append
        )

    go(9)
    with open(record, "a") as file:
        file.write('{"point": [1.0,')  # stopped in the middle of a line
    best, count = go(14)
    assert (len(calls), count) == (14, 14) and "goes on after 9" in " ".join(lines)
    values = [json.loads(line)["value"] for line in record.read_text().splitlines()[1:]]
    assert len(values) == 14 and best.value == min(values)
    with pytest.raises(UserError, match="another search"):
        go(14, of="a cone")
    record.write_text("no record\n")
    with pytest.raises(UserError, match="not the record"):
        go(14)


def test_a_file_no_search_made_is_not_written_over(tmp_path):
    out = tmp_path / "mine.toml"
    assert check_out(out) == tmp_path / "mine.jsonl"
    for nothing in (".", ""):
        with pytest.raises(UserError, match=r"must be a name that ends in \.toml"):
            check_out(Path(nothing))
    out.write_text("steps = 3\n")
    with pytest.raises(UserError, match=r"mine\.toml: is there already"):
        check_out(out)
    (tmp_path / "mine.jsonl").touch()
    check_out(out)
    with pytest.raises(UserError, match=r"ends in \.toml"):
        check_out(tmp_path / "mine.jsonl")
    with pytest.raises(UserError, match="no folder"):
        check_out(tmp_path / "nowhere" / "g.toml")


def test_without_the_optimiser_it_says_how_to_install_it(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "cmaes", None)
    with pytest.raises(UserError, match=r"pip install 'cmpc-walker\[design\]'"):
        recorded(bowl, SPACE, tmp_path / "g.jsonl", {}, seed=0, evaluations=1, measure="depth", say=print)
    assert not list(tmp_path.iterdir())
