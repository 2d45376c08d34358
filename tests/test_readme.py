"""The README says what is true: its figures within what their digits say, its snippet, its picture, its length."""

import json
import re
import subprocess
import sys

import documents
import pytest
from conftest import ROOT

from sim import cli

README = (ROOT / "README.md").read_text()
WITHIN = {"m": 0.001, "s": 0.002, "rad": 0.0001}
"""Tolerance of a figure by its unit, about one in the last digit that the README gives."""
DEAR = ("undisturbed", "payload-x2")  # 50 and 100 steps; `make docs-test` runs them


def rows():
    found = re.findall(r"^\| `(cmpc run [^`]+)`[^|]*\| ([^|]+) \| ([^|]+) \|$", README, re.M)
    assert len(found) == 3
    for command, c_mpc, zd_pd in found:
        mark = [pytest.mark.campaign] if any(name in command for name in DEAR) else []
        yield pytest.param(command, c_mpc.strip(), marks=mark, id=f"{command.split()[2]}-c-mpc")
        yield pytest.param(f"{command} --controller zd-pd", zd_pd.strip(), marks=mark, id=f"{command.split()[2]}-zd-pd")


@pytest.mark.parametrize("command, said", list(rows()))
def test_a_result_is_what_the_table_says(command, said, capsys):
    cli.main([*command.split()[1:], "--no-log", "--json"])
    found = json.loads(capsys.readouterr().out)
    fall = re.fullmatch(r"falls in step (\d+)", said)
    if fall:
        assert (found["outcome"], found["steps"] + 1) == ("fell", int(fall[1]))
        return
    assert (found["outcome"], f"{found['steps']} steps") == ("completed", said.partition(",")[0])
    for pattern, field in (
        (r"([\d.]+) (m) in", "step_length_m"),
        (r"in ([\d.]+) (s)", "step_time_s"),
        (r"RMS ([\d.]+) (rad)", "output_error_rms_rad"),
    ):
        figure = re.search(pattern, said)
        assert figure is None or found[field] == pytest.approx(float(figure[1]), abs=WITHIN[figure[2]]), field


def test_its_snippet_runs_in_an_empty_folder_and_says_why_it_fell(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (snippet,) = [one for one in documents.snippets(ROOT / "README.md") if one.language == "python"]
    exec(snippet.text, {})
    assert capsys.readouterr().out.startswith("fell in step ")
    body = snippet.text.partition("class")[2]
    assert len([line for line in body.splitlines() if line.strip()]) <= 10


def test_it_is_short_and_its_picture_small():
    assert len(README.splitlines()) <= 130
    assert (ROOT / "docs" / "pictures" / "walk.gif").stat().st_size < 2e6


def test_the_page_that_make_see_opens_is_made_by_commands_that_run(tmp_path):
    recipe = re.search(r"^see:.*?\n\n", (ROOT / "Makefile").read_text(), re.M | re.S)[0]
    lines = re.findall(r"cmpc (.*?)(?: \\)?$", recipe, re.M)
    assert len(lines) == 3
    for line in lines:
        documents.parse("cmpc " + line.replace("$$folder", str(tmp_path)))


def test_python_dash_m_sim_is_the_program():
    done = subprocess.run([sys.executable, "-m", "sim", "--version"], cwd=ROOT, capture_output=True, text=True)
    assert done.stdout.startswith("cmpc ")
