"""The world outside a command: pipes nobody reads, full disks, closed outputs, names that are no text."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from spoken import spoken

from sim.cli import COMMANDS
from sim.log.tools.check import check

ROOT = Path(__file__).resolve().parent.parent
SAMPLE = (["--help"], ["run", "--list"], ["log", "info", "{log}"], ["log", "check", "{log}"])


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """A run whose log's name is no UTF-8."""
    path = tmp_path_factory.mktemp("output") / os.fsdecode(b"caf\xe9.mcap")
    done = cmpc(["run", "undisturbed", "--steps", "1", "--quiet", "--log", str(path)], subprocess.PIPE)
    assert done.returncode == 0 and b"caf\\xe9.mcap" in done.stdout.replace(b"\n", b"") and done.stderr == []
    return path


def cmpc(words, stdout, **more):
    command = [sys.executable, "-m", "sim", *words]
    done = subprocess.run(command, cwd=ROOT, stdout=stdout, stderr=subprocess.PIPE, timeout=120, **more)
    done.stderr = spoken(done.stderr.decode())
    return done


def test_a_log_name_that_is_no_text_is_a_name(log):
    assert check(log)[1] == []
    assert cmpc(["replay", str(log), "--quiet"], subprocess.PIPE).stdout.startswith(b"identical")


@pytest.mark.parametrize("words", SAMPLE, ids=" ".join)
def test_a_pipe_that_nobody_reads_ends_in_silence(log, words):
    reader, writer = os.pipe()
    os.close(reader)
    done = cmpc([word.format(log=log) for word in words], writer)
    os.close(writer)
    assert (done.returncode, done.stderr) == (141, [])


@pytest.mark.parametrize("words", SAMPLE, ids=" ".join)
def test_a_full_output_is_one_line(log, words):
    with open("/dev/full", "wb") as full:
        done = cmpc([word.format(log=log) for word in words], full)
    said = ["cmpc: error: standard output cannot be written: No space left on device"]
    assert (done.returncode, done.stderr) == (2, said)


@pytest.mark.parametrize("words", SAMPLE, ids=" ".join)
def test_a_closed_output_is_not_wanted(log, words):
    done = cmpc([word.format(log=log) for word in words], None, preexec_fn=lambda: os.close(1))
    assert (done.returncode, done.stderr) == (0, [])


def test_every_command_shows_its_help_to_a_pipe_that_nobody_reads():
    for command in COMMANDS:
        reader, writer = os.pipe()
        os.close(reader)
        done = cmpc([command, "--help"], writer)
        os.close(writer)
        assert (done.returncode, done.stderr) == (141, []), command
