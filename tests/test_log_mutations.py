"""Mutated logs through every command: nothing breaks, nothing hangs, and no log passes for what it is not.

CMPC_MUTATIONS sets how many are tried (`make logs-proof`: 1000), CMPC_MUTATIONS_FROM the first.
"""

import os
import resource
import sys
import time
import traceback

import pytest

from sim.cli import main
from tests.log_mutations import CHANGES, KEEPS, mutated, recorded

COUNT = int(os.environ.get("CMPC_MUTATIONS", "36"))
FIRST = int(os.environ.get("CMPC_MUTATIONS_FROM", "0"))
PARTS = 4  # one test each, so that two workers share them
LONGEST = 20.0  # [s] for one command, of processor time
MOST = 2**30  # [B] more than before


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    """A sound log, after each command has had it once: all is imported and compiled before children are forked."""
    folder = tmp_path_factory.mktemp("mutations")
    path = recorded(folder)
    for words in commands_for(path, path, folder, "sound").values():
        main([str(word) for word in words])
    return path


def commands_for(bad, good, folder, name):
    """Every command that reads a log, on `bad`."""
    return {
        "info": ["log", "info", bad],
        "check": ["log", "check", bad],
        "recover": ["log", "recover", bad, folder / f"{name}-saved.mcap"],
        "compare": ["log", "compare", bad, good],
        "export": ["log", "export", bad, folder / f"{name}-export"],
        "review": ["review", bad, "--no-open", "--out", folder / f"{name}.html"],
        "replay": ["replay", bad, "--quiet"],
    }


def in_a_child(words, out):
    """Run a command in a process of its own: (exit code, output, seconds, bytes more than before)."""
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    began = time.monotonic()
    pid = os.fork()
    if not pid:
        code = 99
        try:
            with open(out, "w", encoding="utf-8", errors="backslashreplace") as file:
                sys.stdout = sys.stderr = file
                resource.setrlimit(resource.RLIMIT_CPU, (int(LONGEST) + 5, int(LONGEST) + 6))
                try:
                    code = main([str(word) for word in words])
                except BaseException:
                    traceback.print_exc()
        finally:
            os._exit(code)
    _, status, usage = os.wait4(pid, 0)
    text = out.read_text(encoding="utf-8", errors="replace")
    seconds = usage.ru_utime + usage.ru_stime
    code = -os.WTERMSIG(status) if os.WIFSIGNALED(status) else os.WEXITSTATUS(status)
    assert time.monotonic() - began < 600
    return code, text, seconds, usage.ru_maxrss * 1024 - before


def faults(number, path, folder):
    """What goes wrong with one mutated log, a sentence each."""
    kind, name, content = mutated(path.read_bytes(), number)
    bad = folder / f"{number}.mcap"
    bad.write_bytes(content)
    same = content == path.read_bytes()
    told = {}
    for command, words in commands_for(bad, path, folder, str(number)).items():
        code, text, seconds, memory = in_a_child(words, folder / "out.txt")
        told[command] = (code, text)
        where = f"{number} {name}, {command}"
        if code not in (0, 1, 2, 3) or "Traceback" in text:
            yield f"{where}: exit code {code}: {text[-2000:]}"
        if seconds > LONGEST:
            yield f"{where}: {seconds:.1f} s"
        if memory > MOST:
            yield f"{where}: {memory / 2**20:.0f} MB"
    if same:
        return
    (check, checked), (compare, compared), (recover, recovered) = told["check"], told["compare"], told["recover"]
    if kind == KEEPS:
        if check != 0 and name != "without_summary":
            yield f"{number} {name}: not sound: {checked}"
        if compare != 0 or "same ticks, other container" not in compared:
            yield f"{number} {name}: compare says {compared[-300:]}"
        if recover != 0 or "all there was" not in recovered:
            yield f"{number} {name}: a loss that is none: {recovered}"
        if told["replay"][0] != 0:
            yield f"{number} {name}: replay says {told['replay'][1][-300:]}"
        return
    if check == 0:
        yield f"{number} {name}: wrong 'sound'"
    if compare == 0 or "identical" in compared or "other container" in compared:
        yield f"{number} {name}: wrong verdict: {compared[-300:]}"
    if told["replay"][1].startswith("identical") or told["replay"][0] == 0:
        yield f"{number} {name}: replay: wrong 'identical'"
    if kind == CHANGES and name in ("other_outcome", "other_figure", "other_run", "other_format") and recover != 0:
        yield f"{number} {name}: a loss that is none: {recovered}"


@pytest.mark.parametrize("part", range(PARTS))
def test_mutated_logs_break_nothing_and_deceive_nobody(part, path, tmp_path):
    wrong = []
    for number in range(FIRST + part, FIRST + COUNT, PARTS):
        folder = tmp_path / str(number)
        folder.mkdir()
        for line in faults(number, path, folder):
            wrong.append(line)
            print(line, flush=True)
        for left in sorted(folder.rglob("*"), reverse=True):
            left.unlink() if left.is_file() else left.rmdir()
    print(f"part {part} of {COUNT} mutated logs, {len(wrong)} faults")
    assert not wrong, "\n".join(wrong)
