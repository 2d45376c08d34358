"""Every command block and snippet of README and docs, run in a scratch folder a page: `make docs-test`.

What would take minutes runs in a cheaper form, which `CHEAP` states; what needs a display or the network, or costs a
quarter of an hour, is parsed as the program parses it. Each line that is not run as it stands is printed with its form.
"""

import importlib
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
BLOCK = re.compile(r"^( *)```(\w*)\n(.*?)^\1```", re.M | re.S)
INDENTED = re.compile(r"^    (cmpc .*)$", re.M)
PARSED = "parsed only"
NO_OPENGL = "cmpc: error: MuJoCo cannot draw here"  # on a machine without EGL, what films is as right as it can be

CHEAP = (
    (r"^cmpc trials (numerics|certify) .*", PARSED),
    (r"^cmpc run tuned.toml", r"cmpc run gains.toml --steps 3"),
    (r"^(cmpc run --from-trial \S+#)\S+", r"\1zd-pd/0"),
    (r"^(cmpc trials show \S+ --trial) \S+", r"\1 zd-pd/0"),
    (r"^cmpc gait import .*", PARSED),
    (r"^cmpc trials machine.toml .*", PARSED),
    (r"^cmpc trials bench", r"cmpc trials bench --trials 4"),
    (r"^cmpc trials \w+ (.*--out \S+).*", r"cmpc trials tiny.toml \1"),
    (r"^cmpc reproduce all( --quick)?$", r"cmpc reproduce fig3 --quick"),
    (r"^cmpc (reproduce|poincare|basin|bench|weights search|gait library|limit|design)\b.*", PARSED),
    (r"^(cmpc gains search .*)", r"\1 --evaluations 3"),
    (r"^cmpc walker check rabbit", PARSED),
    (r"^(cmpc walker check \S+)", r"\1 --steps 2"),
    (r"^(cmpc run .*)--steps \d+(.*)", r"\1--steps 3\2"),
    (r"^cmpc run .*--(viewer|live).*", PARSED),
    (r"^(cmpc review .*)", r"\1 --no-open"),
)
"""Pattern of a line, and what runs in its place."""

TINY = """
controllers = ["zd-pd"]
[scenario]
steps = 3
[[grid]]
[[grid.axes]]
paths = ["pushes.0.force"]
also = ["pushes.0.step = 1"]
values = [5.0, 60.0]
"""


class Snippet(NamedTuple):
    """A block of a page: its language, its text, the line it begins at."""

    language: str
    text: str
    line: int


def snippets(page: Path) -> list[Snippet]:
    """Blocks of a page, and commands that are only indented, in order."""
    text = page.read_text(encoding="utf-8")
    found = [Snippet(m[2], re.sub(rf"^{m[1]}", "", m[3], flags=re.M), _line(text, m)) for m in BLOCK.finditer(text)]
    rest = BLOCK.sub(lambda m: "\n" * m[0].count("\n"), text)
    found += [Snippet("sh", m[1] + "\n", _line(rest, m)) for m in INDENTED.finditer(rest)]
    return sorted(found, key=lambda snippet: snippet.line)


def _line(text: str, match: re.Match[str]) -> int:
    return text.count("\n", 0, match.start()) + 1


def commands(page: Path) -> list[tuple[int, str]]:
    """Every line of a page that is a command of ours, without its comment, with its number."""
    return [
        (snippet.line + 1 + at, re.sub(r"\s+#.*", "", line).strip())
        for snippet in snippets(page)
        if snippet.language in ("", "sh", "bash")
        for at, line in enumerate(snippet.text.splitlines())
        if re.match(r"(cmpc|make)\b", line)
    ]


def parse(line: str) -> None:
    """Parse a command line as the program does, without running it.

    Raises:
        UserError: the program would refuse it.
    """
    from sim.settings.flags import Parser

    words = shlex.split(line)[1:]
    if not words:
        return
    parser = Parser(prog="cmpc")
    parser.add_argument("--version", action="store_true")
    importlib.import_module(f"sim.commands.{words[0]}").add_parser(parser.add_subparsers(prog="cmpc"), words[1:])
    parser.parse(words)


def cheap(line: str) -> str:
    """What runs in place of a command line."""
    for pattern, form in CHEAP:
        if re.search(pattern, line):
            return PARSED if form == PARSED else re.sub(pattern, form, line)
    return line


class Bench:
    """A scratch folder with what the pages take for granted: logs, a robot's file, a tiny plan."""

    def __init__(self, folder: Path) -> None:
        """Args: folder: empty."""
        self.bin = folder / "bin"
        self.bin.mkdir()
        program = self.bin / "cmpc"
        program.write_text(f'#!/bin/sh\nexec "{sys.executable}" -P -m sim "$@"\n')
        program.chmod(0o755)
        self.stock = folder / "stock"
        self.stock.mkdir()
        self.environment = {
            **os.environ,
            "PYTHONPATH": str(ROOT),
            "PATH": f"{self.bin}{os.pathsep}{os.environ['PATH']}",
        }
        for name, controller in (("RUN.mcap", "c-mpc"), ("A.mcap", "c-mpc"), ("B.mcap", "zd-pd")):
            self.run(self.stock, f"cmpc run push-25N --steps 2 --controller {controller} --quiet --log {name}")
        (self.stock / "tiny.toml").write_text(TINY)
        self.run(self.stock, "cmpc trials tiny.toml --out results --quiet")
        for name in ("my-biped.urdf", "mine.urdf", "robot.urdf"):
            shutil.copy(ROOT / "models" / "rabbit" / "rabbit.urdf", self.stock / name)

    def run(self, folder: Path, line: str) -> str:
        """Run a line by the shell; what went wrong, empty for nothing."""
        words = ["bash", "-c", line]
        done = subprocess.run(words, cwd=folder, env=self.environment, capture_output=True, text=True, timeout=600)
        if NO_OPENGL in done.stderr:
            return ""
        wrong = done.returncode not in (0, 1) or "Traceback" in done.stderr
        return f"exit code {done.returncode}\n{done.stdout[-800:]}{done.stderr[-2000:]}" if wrong else ""

    def page(self, page: Path, folder: Path) -> Iterator[tuple[str, str]]:
        """Run a page from top to bottom: (what, what went wrong)."""
        shutil.copytree(self.stock, folder)
        targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.M))
        named_by = r"# ([\w./-]+\.(?:py|toml))\n"
        for snippet in snippets(page):  # all files first: a command may stand before its file
            named = re.match(named_by, snippet.text)
            if named and snippet.language in ("python", "toml"):
                (folder / named[1]).write_text(snippet.text, encoding="utf-8")
        for snippet in snippets(page):
            named = re.match(named_by, snippet.text)
            if snippet.language == "python":
                name = named[1] if named else "snippet.py"
                if not named:
                    (folder / name).write_text(snippet.text, encoding="utf-8")
                yield f"{page.name}:{snippet.line} {name}", self.run(folder, f"{sys.executable} {name}")
            if snippet.language not in ("", "sh", "bash"):
                continue
            for line in snippet.text.splitlines():
                words = re.sub(r"\s+#.*", "", line).strip()
                what = f"{page.name}:{snippet.line} {words}"
                if words.startswith("make "):
                    yield what, "" if words.split()[1] in targets else "no such target"
                elif words.startswith("cmpc"):
                    yield from self._command(folder, words, what)

    def _command(self, folder: Path, words: str, what: str) -> Iterator[tuple[str, str]]:
        form = cheap(words)
        if form == PARSED:
            here = os.getcwd()
            os.chdir(folder)
            try:
                parse(words)
                yield f"{what}   [{PARSED}]", ""
            except Exception as error:
                yield what, str(error)
            finally:
                os.chdir(here)
            return
        yield what + (f"   [as {form}]" if form != words else ""), self.run(folder, form)


def main() -> None:
    """Run the pages named, or all of them; exit code 1 if anything went wrong."""
    sys.path.insert(0, str(ROOT))
    pages = [page for page in PAGES if not sys.argv[1:] or page.name in sys.argv[1:] or page.stem in sys.argv[1:]]
    failed = 0
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(Path(folder))
        for page in pages:
            began = time.perf_counter()
            for what, wrong in bench.page(page, Path(folder) / page.stem):
                took, began = time.perf_counter() - began, time.perf_counter()
                print(f"{'FAIL' if wrong else 'ok  '} {took:6.1f} s  {what}", flush=True)
                failed += bool(wrong)
                if wrong:
                    print(wrong)
    print(f"{failed} failed" if failed else "all of it runs")
    sys.exit(bool(failed))


if __name__ == "__main__":
    main()
