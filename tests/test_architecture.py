"""The house rules that a machine can check: two worlds, layers, and one home for every equation."""

import ast
import re
import subprocess
import sys
from collections import Counter

import pytest
from conftest import ROOT
from importlinter.cli import EXIT_STATUS_SUCCESS, lint_imports

CONTROLLER = ROOT / "controller"
EQUATIONS = range(1, 25)
COMMON_GROUND = "controller.common"
"""What both worlds may know."""


def test_import_contracts_hold(capsys, monkeypatch):
    monkeypatch.chdir(ROOT)
    status = lint_imports(config_filename="pyproject.toml", no_cache=True)
    assert status == EXIT_STATUS_SUCCESS, capsys.readouterr().out


def loaded_by(*modules):
    """Top-level names, and the controller's modules, in a fresh interpreter after these imports."""
    code = f"import sys, {', '.join(modules)}; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    names = done.stdout.split()
    return {name.split(".")[0] for name in names}, {name for name in names if name.startswith("controller.")}


def test_the_controller_loads_nothing_of_the_plant():
    modules = sorted(".".join(path.relative_to(ROOT).with_suffix("").parts) for path in CONTROLLER.rglob("[a-z]*.py"))
    found, _ = loaded_by(*modules)
    assert {"controller", "pinocchio", "numba", "qpsolvers"} <= found  # it did load its own
    assert not {"sim", "mujoco", "mcap"} & found


def test_the_plant_loads_nothing_of_the_controller():
    found, of_the_controller = loaded_by(
        "sim.plant.mujoco_plant", "sim.plant.rigid_plant", "sim.loop.loop", "sim.log.write", "sim.log.read.reader"
    )
    assert {"sim", "mujoco", "mcap"} <= found
    assert not {"pinocchio", "qpsolvers"} & found
    assert all(name.startswith(COMMON_GROUND) for name in of_the_controller)


# Equations

LINE = re.compile(r"Implements: (Eqs?\. .*?\))\.(?:\s|$)", re.S)


def numbers(text):
    """[1, 4, 5, 6] of "Eqs. (1), (4)-(6)"."""
    assert re.fullmatch(r"Eqs?\. (\(\d+\)(-\(\d+\))?)(, \(\d+\)(-\(\d+\))?)*", text), text
    found = []
    for first, last in re.findall(r"\((\d+)\)(?:-\((\d+)\))?", text):
        found += range(int(first), int(last or first) + 1)
    assert text.startswith("Eqs. ") == (len(found) > 1), text
    return found


def docstrings(tree, prefix=""):
    """(qualified name, docstring) of a module's classes and functions; the module itself has the name ""."""
    yield prefix, ast.get_docstring(tree) or ""
    for node in tree.body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            yield from docstrings(node, f"{prefix}.{node.name}".lstrip("."))


@pytest.fixture(scope="module")
def homes():
    """(equation, qualified name, file) for each `Implements:` line in `controller/`."""
    found = []
    for path in sorted(CONTROLLER.rglob("*.py")):
        for name, text in docstrings(ast.parse(path.read_text())):
            assert text.count("Implements:") == len(LINE.findall(text)), (path.name, name)
            for line in LINE.findall(text):
                found += [(n, name, path.relative_to(CONTROLLER).as_posix()) for n in numbers(line)]
    return found


def test_every_equation_has_exactly_one_home(homes):
    count = Counter(equation for equation, _, _ in homes)
    assert {n: count[n] for n in EQUATIONS} == dict.fromkeys(EQUATIONS, 1)
    assert all(name for _, name, _ in homes)  # a function or class, not a whole module


def test_the_table_of_equations_says_where_they_are(homes):
    rows = re.findall(
        r"^\| \((\d+)\) \|.*\| `([\w.]+)` \| ([\w./]+) \|$", (CONTROLLER / "equations.md").read_text(), re.M
    )
    table = [(int(number), name, file) for number, name, file in rows]
    assert [row[0] for row in table] == list(EQUATIONS)
    assert sorted(table) == sorted(home for home in homes if home[0] in EQUATIONS)


def test_no_equation_cited_in_the_code_is_unknown():
    """Every "Eq. (n)" in the controller is a number of the paper."""
    for path in CONTROLLER.rglob("*.py"):
        for line in path.read_text().splitlines():
            for cited in re.findall(r"Eqs?\. ([()\d, -]*)", line):
                assert all(1 <= int(n) <= 24 for n in re.findall(r"\((\d+)\)", cited)), (path.name, line)
