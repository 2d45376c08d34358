"""Every example runs in an empty folder and says what its page promises; the dear ones in `make docs-test`."""

import ast
import json
import runpy

import pytest
from conftest import ROOT

SCRIPTS = sorted((ROOT / "examples").glob("*.py"))
NOTEBOOKS = sorted((ROOT / "examples").glob("*.ipynb"))
DEAR = ("own_robot", "nearest_fall", "limit_beside", "live_view")  # `make docs-test` runs them
SAYS = {
    "own_controller": ["undisturbed: completed after 10 steps", "push-40N-first: fell"],
    "payload_table": [r"\begin{tabular}", "falls in step"],
    "what_if": ["to the last bit: True", "under C-MPC: completed"],
    "fall_explained": ["it fell in step 2", "torque: a joint is at its limit", "impact"],
}


@pytest.fixture(autouse=True)
def in_an_empty_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize("script", [path for path in SCRIPTS if path.stem not in DEAR], ids=lambda path: path.stem)
def test_a_script_runs_and_says_so(script, capsys):
    runpy.run_path(str(script), run_name="__main__")
    out = capsys.readouterr().out
    for words in SAYS.get(script.stem, []):
        assert words in out, out


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_and_shows_itself(notebook):
    cells = json.loads(notebook.read_text())["cells"]
    assert all(not cell["outputs"] for cell in cells if cell["cell_type"] == "code")
    names, shown = {"__name__": "__main__"}, 0
    for cell in cells:
        if cell["cell_type"] != "code":
            continue
        tree = ast.parse("".join(cell["source"]))
        last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
        exec(compile(tree, str(notebook), "exec"), names)
        if last is not None:  # what a notebook shows
            value = eval(compile(ast.Expression(last.value), str(notebook), "eval"), names)
            shown += len(value._repr_html_()) > 100
    assert shown >= 2


def test_a_controller_of_ones_own_and_why_it_fell_takes_twenty_lines():
    cells = json.loads((ROOT / "examples" / "own_controller.ipynb").read_text())["cells"]
    lines = [line for cell in cells[:3] if cell["cell_type"] == "code" for line in cell["source"] if line.strip()]
    assert len(lines) <= 20


def test_the_page_names_every_example():
    page = (ROOT / "docs" / "examples.md").read_text()
    for path in (*SCRIPTS, *NOTEBOOKS):
        assert f"../examples/{path.name}" in page, path.name
    assert len(NOTEBOOKS) == 3


@pytest.mark.campaign
@pytest.mark.parametrize("script", [path for path in SCRIPTS if path.stem in DEAR], ids=lambda path: path.stem)
def test_a_dear_script_runs(script):
    runpy.run_path(str(script), run_name="__main__")
