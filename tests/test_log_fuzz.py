"""Random damage to a log: told, survived, and never called identical. CMPC_FUZZ sets how many damages are tried."""

import contextlib
import os
import signal
from itertools import cycle

import numpy as np
import pytest

from sim.bridge.run import run_scenario
from sim.cli import main
from sim.log.read import read_log, salvage
from sim.log.read.scan import scan
from sim.scenario import load, with_values

DAMAGES = int(os.environ.get("CMPC_FUZZ", "80"))
LONGEST = 20  # [s] for one command


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("fuzz") / "run.mcap"
    changes = {"time_limit": 0.25, "controller.horizon": 10}
    run_scenario(with_values(load("push-40N-first"), changes), log=path)
    return path


@contextlib.contextmanager
def at_most(seconds):
    def give_up(*_):
        raise TimeoutError(f"took longer than {seconds} s")

    before = signal.signal(signal.SIGALRM, give_up)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def damaged(data, rng):
    """One to three flipped bits, or a cut, or both; never the file as it was."""
    out = bytearray(data)
    kind = rng.integers(4)
    if kind < 3:
        for _ in range(1 + 2 * (kind == 2)):
            out[rng.integers(len(out))] ^= 1 << rng.integers(8)
    if kind >= 2:
        out = out[: rng.integers(len(out))]
    return bytes(out)


def test_damage_is_told_and_survived(path, tmp_path, capsys):
    data, rng = path.read_bytes(), np.random.default_rng(7)
    turns = cycle(("recover", "review", "export", "compare"))
    for number in range(DAMAGES):
        bad, out = tmp_path / f"{number}.mcap", tmp_path / f"{number}-out"
        content = damaged(data, rng)
        if content == data:
            continue
        bad.write_bytes(content)
        commands = {
            "info": (["log", "info", bad], {0, 2}),
            "check": (["log", "check", bad], {1, 2}),
            "replay": (["replay", bad, "--quiet"], {1, 2, 3}),
            "recover": (["log", "recover", bad, out], {1, 2}),
            "review": (["review", bad, "--no-open", "--out", out], {0, 2}),
            "export": (["log", "export", bad, out], {1, 2}),
            "compare": (["log", "compare", bad, path], {1, 2}),
        }
        wanted = commands if DAMAGES >= 400 else ("info", "check", "replay", next(turns))
        for name in wanted:
            words, legal = commands[name]
            if name in ("review", "export"):
                out = words[-1]
                words = [*words[:-1], tmp_path / f"{number}-{name}"]
            with at_most(LONGEST):
                code = main([str(word) for word in words])
            told = capsys.readouterr()
            if name == "recover" and code == 0:  # the damage is behind the data, in what only repeats them
                walked = scan(content)
                assert walked.ended and not walked.problems
                assert main(["log", "compare", str(path), str(out)]) == 0
                capsys.readouterr()
                continue
            assert code in legal, (number, name, told)
            assert not told.out.startswith("identical")
            if name == "recover" and code == 1:
                assert read_log(out).complete
            if name in ("info", "review", "export") and code < 2:
                log = salvage(bad)
                assert told.err.count("warning") == 0 or log.problems or not log.complete
                assert told.err or name == "review" or not (log.problems or not log.complete), (number, name)
