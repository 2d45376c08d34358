"""The documents say what is true of the code: the picture, the list of places, the paths and commands they name."""

import ast
import importlib.util
import re

import documents
import pytest
from conftest import ROOT

from sim.cli import COMMANDS
from sim.commands.new import CONTROLLER
from sim.scenario import from_toml, settings_table
from sim.trials.plan.plan import from_toml as plan_of

TEXT = (ROOT / "docs" / "architecture.md").read_text()
PATH = re.compile(r"`((?:controller|sim|docs|tests|models)/[\w./]+)`")


@pytest.fixture(scope="module")
def drawing():
    spec = importlib.util.spec_from_file_location("architecture", ROOT / "docs" / "architecture.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_picture_is_that_of_the_imports(drawing):
    assert (ROOT / "docs" / "architecture.svg").read_text() == drawing.picture(), "make docs draws it again"


def test_what_the_picture_leaves_out_follows_from_what_it_shows(drawing):
    graph, shown = drawing.rooms(), drawing.needed(drawing.rooms())
    reached = {room: {b for a, b in shown if a == room} for room in graph}
    for _ in graph:
        reached = {room: found.union(*(reached[b] for b in found)) for room, found in reached.items()}
    assert all(graph[room] <= reached[room] for room in graph)
    levels = drawing.floors(graph)
    assert all(levels[a] > levels[b] for a in graph for b in graph[a] if a.split(".")[0] == b.split(".")[0])


def rows():
    """(what, path, name) of the list of places."""
    found = re.findall(r"^\| ([^|]+) \| `([\w./]+)` \| (?:`(\w+)`)? *\|$", TEXT, re.M)
    assert len(found) >= 20
    return found


@pytest.mark.parametrize("what, path, name", rows())
def test_each_thing_is_where_the_list_says(what, path, name):
    tree = ast.parse((ROOT / path).read_text())
    names = {node.name for node in tree.body if isinstance(node, ast.FunctionDef | ast.ClassDef)}
    names |= {
        part.id
        for node in tree.body
        if isinstance(node, ast.Assign)
        for part in ast.walk(node.targets[0])
        if isinstance(part, ast.Name)
    }
    assert not name or name in names, (path, sorted(names))


@pytest.mark.parametrize("document", ["docs/architecture.md", "CONTRIBUTING.md", "README.md"])
def test_paths_and_links_of_a_document_exist(document):
    text = (ROOT / document).read_text()
    missing = [path for path in PATH.findall(text) if not (ROOT / path).exists()]
    folder = (ROOT / document).parent
    missing += [link for link in re.findall(r"\]\(([^)#:]+)\)", text) if not (folder / link).exists()]
    assert missing == []


@pytest.mark.parametrize("document", ["CONTRIBUTING.md", "README.md"])
def test_commands_and_targets_of_a_document_exist(document):
    text = (ROOT / document).read_text()
    assert set(re.findall(r"^cmpc (\w+)", text, re.M)) <= set(COMMANDS)
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.M))
    assert set(re.findall(r"`make ([a-z-]+)", text)) <= targets


@pytest.mark.parametrize("page", documents.PAGES, ids=lambda page: page.name)
def test_every_command_of_a_page_is_one_the_program_takes(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.py").write_text(CONTROLLER)
    for snippet in documents.snippets(page):
        named = re.match(r"# ([\w./-]+\.(?:py|toml))\n", snippet.text)
        if named:
            (tmp_path / named[1]).write_text(snippet.text)
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.M))
    for line, command in documents.commands(page):
        if command.startswith("make "):
            assert command.split()[1] in targets, (line, command)
        else:
            documents.parse(command)


def test_each_file_of_the_page_of_scenarios_is_one_the_program_takes():
    files = [s.text for s in documents.snippets(ROOT / "docs" / "scenarios.md") if s.language == "toml"]
    plans = [text for text in files if re.search(r"^\[\[(grid|reliability)\]\]", text, re.M)]
    assert [from_toml(text).steps for text in files if text not in plans] == [12]
    assert [len(plan_of(text).studies) for text in plans] == [1, 1]


def test_each_message_of_the_page_of_errors_is_the_programs_own():
    page = (ROOT / "docs" / "errors.md").read_text()
    messages = re.findall(r"^\| `([^`]+)` \|", page, re.M)
    texts = [path.read_text() for folder in ("sim", "controller") for path in (ROOT / folder).rglob("*.py")]
    source = "\n".join(re.sub(r'"\s*\n\s*f?"', "", text) for text in texts)
    assert len(messages) >= 25 and [words for words in messages if words not in source] == []


def test_the_page_of_settings_has_every_one_with_its_unit():
    spec = importlib.util.spec_from_file_location("reference", ROOT / "docs" / "reference.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    page = module.page()
    for row in settings_table():
        name = row.path.rpartition(".")[2]
        assert re.search(rf"^\| `{name}` \| {re.escape(row.spec.unit)} \|", page, re.M), row.path


def test_the_site_names_pages_that_are_there_and_each_once():
    site = (ROOT / "mkdocs.yml").read_text()
    pages = re.findall(r": ([\w-]+\.md)$", site, re.M)
    assert len(pages) == len(set(pages))
    assert set(pages) <= {path.name for path in (ROOT / "docs").glob("*.md")} | {"settings.md"}
    assert len(pages) >= 18
