"""Falsified results are found, also where whoever falsified them made a new signature. CMPC_FALSE sets how many."""

import json
import os
import re

import numpy as np
import pytest
from foxglove_schemas_protobuf.Log_pb2 import Log as Event

from sim.log.format import seal
from sim.log.read.reader import log_of, read_log
from sim.log.read.scan import scan
from sim.log.tools.check import check
from sim.log.tools.signed import signature_now, signature_problems
from tests.log_mutations import Parts, recorded

COUNT = int(os.environ.get("CMPC_FALSE", "20"))
FIGURES = (
    "time_s",
    "step_time_s",
    "peak_torque_Nm",
    "friction_ratio_max",
    "output_error_rms_rad",
    "mpc_torque_share",
    "fallbacks",
    "slack_max_N",
    "rms_torque_Nm",
    "speed_m_s",
    "slip_m",
    "ticks",
    "tick_ms",
)
"""What the ticks tell, so that not even a new signature helps."""


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return recorded(tmp_path_factory.mktemp("false"))


def falsify(parts, rng):
    """Change the outcome, the steps, a figure or an event; what was changed in words."""
    result = parts.said("result")
    kind = ("outcome", "steps", "figure", "event")[int(rng.integers(4))]
    if kind == "outcome":
        result["outcome"] = str(rng.choice([o for o in ("completed", "fell", "interrupted") if o != result["outcome"]]))
        if result["outcome"] == "completed":
            result["fall_reason"] = ""
    elif kind == "steps":
        result["steps"] = str(int(result["steps"]) + int(rng.choice([-1, 1, 9])))
    elif kind == "figure":
        kind = str(rng.choice(FIGURES))
        value = json.loads(result[kind])
        factor = float(rng.choice([0.5, 0.9, 1.1, 2.0]))
        if isinstance(value, dict):
            key = str(rng.choice(list(value)))
            value[key] = value[key] * factor + 1.0
        else:
            value = value + 1 if isinstance(value, int) else value * factor + 0.01
        result[kind] = json.dumps(value)
    else:
        places = [i for i in parts.of_topic("/events") if b"impact" in parts.messages[i].data]
        at = int(rng.choice(places))
        event = Event.FromString(parts.messages[at].data)
        if rng.integers(2):
            event.message = re.sub(r"(\d)\.(\d)", lambda m: f"{m[1]}.{(int(m[2]) + 3) % 10}", event.message)
            parts.messages[at].data = event.SerializeToString(deterministic=True)
        else:
            parts.messages.pop(at)
    return kind


def sign_again(data):
    """The same log with a new signature over what it now says."""
    parts = Parts.of(data)
    result = parts.said("result")
    result.pop(seal.KEY)
    result[seal.KEY] = json.dumps(signature_now(log_of("x", scan(data)), dict(result)))
    return parts.write()


def test_a_run_is_signed_and_sound(path):
    log, problems = check(path)
    assert problems == [] and seal.KEY in log.metadata["result"] and signature_problems(log) == []


@pytest.mark.parametrize("signed_again", [False, True])
def test_every_falsified_result_is_found(path, tmp_path, signed_again):
    data, missed = path.read_bytes(), []
    for number in range(COUNT):
        parts = Parts.of(data)
        kind = falsify(parts, np.random.default_rng([5, number]))
        false = parts.write()
        if signed_again:
            false = sign_again(false)
            assert signature_problems(log_of("x", scan(false))) == []
        (tmp_path / "false.mcap").write_bytes(false)
        _, problems = check(tmp_path / "false.mcap")
        if not problems:
            missed.append((number, kind))
    print(f"{COUNT - len(missed)} of {COUNT} found")
    assert not missed


def test_a_signature_does_not_depend_on_the_container(path):
    log = read_log(path)
    written = json.loads(log.metadata["result"][seal.KEY])
    result = {key: text for key, text in log.metadata["result"].items() if key != seal.KEY}
    assert signature_now(log, result) == written


def test_a_signature_taken_away_is_missed(path, tmp_path):
    parts = Parts.of(path.read_bytes())
    del parts.said("result")[seal.KEY]
    (tmp_path / "x.mcap").write_bytes(parts.write())
    assert check(tmp_path / "x.mcap")[1] == ["the result is not signed"]


def test_logs_of_format_1_are_unsigned_and_sound(path, tmp_path, capsys):
    from sim.cli import main

    parts = Parts.of(path.read_bytes())
    del parts.said("result")[seal.KEY]
    parts.said("run")["format"] = "1"
    (tmp_path / "old.mcap").write_bytes(parts.write())
    assert main(["log", "check", str(tmp_path / "old.mcap")]) == 0
    assert "sound, unsigned" in capsys.readouterr().out
    assert main(["replay", str(tmp_path / "old.mcap"), "--quiet"]) == 0
