"""The exit codes that are documented: each can be provoked, and the table lists no other."""

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from spoken import spoken

from sim import cli
from sim.commands.replay import EXIT_PARTIAL
from sim.log.read import read_log

ROOT = Path(__file__).parent.parent
TABLE = {int(code) for code in re.findall(r"^\| (\d+) \|", (ROOT / "docs/exit-codes.md").read_text(), flags=re.M)}
SIGNALS = {129: signal.SIGHUP, 130: signal.SIGINT, 143: signal.SIGTERM}


def test_the_table_is_that_of_these_tests() -> None:
    assert {0, 1, 2, EXIT_PARTIAL, 141, *SIGNALS} == TABLE  # 3: tests/test_replay.py


def test_a_yes_a_no_and_bad_input(capsys) -> None:
    assert cli.main(["--version"]) == 0
    assert cli.main(["gait", "check", "paper", "--torque-share", "0.01"]) == 1
    assert cli.main(["trials", "nowhere.toml", "--out", "o"]) == 2
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.parametrize("code", SIGNALS)
def test_signals_end_a_run_whose_log_is_whole(code: int, tmp_path: Path) -> None:
    log = tmp_path / "run.mcap"
    command = [sys.executable, "-m", "sim", "run", "undisturbed", "--controller", "zd-pd", "--quiet"]
    command += ["--steps", "100000", "--time-limit", "100000", "--log", str(log)]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process:
        while not log.exists() and process.poll() is None:
            time.sleep(0.02)
        time.sleep(0.5)
        process.send_signal(SIGNALS[code])
        _, err = process.communicate(timeout=120)
    assert process.returncode == code and "Traceback" not in err
    found = read_log(log)
    assert found.complete and found.metadata["result"]["outcome"] == "interrupted"


@pytest.mark.parametrize("words", [["run", "--list"], ["trials", "--list"]])
def test_nobody_reads_or_nothing_can_be_written(words: list[str]) -> None:
    read, write = os.pipe()
    os.close(read)
    command = [sys.executable, "-m", "sim", *words]
    for target, code, lines in ((write, 141, 0), (os.open("/dev/full", os.O_WRONLY), 2, 1)):
        done = subprocess.run(command, cwd=ROOT, stdout=target, stderr=subprocess.PIPE, text=True)
        os.close(target)
        assert done.returncode == code and len(spoken(done.stderr)) == lines, done.stderr
    closed = subprocess.run(command, cwd=ROOT, stderr=subprocess.PIPE, text=True, preexec_fn=lambda: os.close(1))
    assert closed.returncode == 0 and spoken(closed.stderr) == []


def test_ctrl_c_after_the_last_word_takes_no_exit_code_away():
    for delay in (0.0, 0.005, 0.01, 0.02):
        words = [sys.executable, "-m", "sim", "--version"]
        with subprocess.Popen(words, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as done:
            assert done.stdout.readline().strip()
            time.sleep(delay)
            done.send_signal(signal.SIGINT)
            assert (done.communicate(timeout=60)[1], done.returncode) == ("", 0)
