"""A log says what happened, survives what ends a run, and is the same for the same run."""

import json
import os
import signal
import subprocess
import sys
from dataclasses import replace
from functools import cache
from math import cos, sin
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.records import DataEnd
from mcap.stream_reader import StreamReader
from mcap_protobuf.decoder import DecoderFactory

from sim.errors import UserError
from sim.interface import COORDINATES, JOINTS, LEGS, ControlStep, Observation, PlantState
from sim.log.format.fields import CHANNELS, LINKS, OUTPUTS, STATUSES
from sim.log.provenance import git_state, package_versions
from sim.log.read import read_log
from sim.log.read.reader import read_channel
from sim.log.write import Recorder, RunHeader
from sim.loop import RunSummary
from tests.fakes import tell

ROOT = Path(__file__).resolve().parent.parent
LENGTHS = {link: 0.625 if link == "torso" else 0.4 for link in LINKS}  # [m]
PERIOD = 1e-3  # [s]
HEADER = RunHeader(
    scenario_name="push-25N",
    scenario_toml="seed = 3\n",
    seed=3,
    versions={"mujoco": "4.0.0", "mcap": "1.6.0"},
    git_revision="0123abcd",
    git_dirty=True,
    platform="Linux",
    started="2024-01-01T00:00:00+00:00",
    link_lengths=LENGTHS,
    attachments={"rabbit.xml": ("application/xml", b"<mujoco/>"), "empty.txt": ("text/plain", b"")},
)
SUMMARY = RunSummary(
    outcome="completed",
    fall_reason="",
    steps=10,
    time_s=5.2,
    step_time_s=0.52,
    step_length_m=None,
    peak_torque_Nm={joint: 50.0 for joint in JOINTS},
    torque_limit_Nm={joint: 75.0 for joint in JOINTS},
    friction_ratio_max=0.4,
    output_error_rms_rad=0.01,
    mpc_torque_share=0.1,
    solve_ms={"median": 0.5},
    tick_ms={"median": 0.6},
    fallbacks=0,
    slack_max_N=0.0,
    realtime_factor=2.0,
)


def tick(k):
    """State, observation and step of tick `k`; all numbers differ."""
    rng = np.random.default_rng(k)

    def flag():
        return bool(rng.integers(2))

    state = PlantState(
        t=k * PERIOD,
        q=rng.normal(size=5),
        dq=rng.normal(size=5),
        hip=rng.normal(size=2),
        dhip=rng.normal(size=2),
        foot=rng.normal(size=(2, 2)),
        clearance=rng.normal(size=2),
        torque=rng.normal(size=4),
        contact=(flag(), flag()),
        contact_force=rng.normal(size=(2, 2)),
        push=rng.normal(size=2),
        penetrating=("torso", "right_femur") if flag() else (),
    )
    seen = Observation(t=k * PERIOD, q=rng.normal(size=5), dq=rng.normal(size=5), contact=(flag(), flag()))
    step = ControlStep(
        stance=LEGS[k % 2],
        u_zd=rng.normal(size=4),
        u_mpc=rng.normal(size=4),
        u_total=rng.normal(size=4),
        y=rng.normal(size=4),
        dy=rng.normal(size=4),
        theta=rng.normal(),
        dtheta=rng.normal(),
        s=rng.normal(),
        contact_force=rng.normal(size=2),
        impact_in=int(rng.integers(-1, 100)),
        status=STATUSES[1 + k % 2],
        fallback=flag(),
        iterations=int(rng.integers(50)),
        residuals=rng.normal(size=3),
        slack=rng.normal(),
        active=int(rng.integers(400)),
        solve_s=rng.normal(),
    )
    return state, seen, step


@cache
def expected(k):
    """Topic -> dotted field name -> value that tick `k` must show, spelt out apart from the recorder."""
    state, seen, step = tick(k)

    def named(prefix, names, values):
        return {f"{prefix}.{name}": value for name, value in zip(names, values, strict=True)}

    feet_xz = tuple(f"{leg}.{axis}" for leg in LEGS for axis in "xz")
    feet_tn = tuple(f"{leg}.{axis}" for leg in LEGS for axis in ("tangential", "normal"))
    return {
        "/plant/state": {
            **named("q", COORDINATES, state.q),
            **named("dq", COORDINATES, state.dq),
            **named("hip", "xz", state.hip),
            **named("dhip", "xz", state.dhip),
            **named("foot", feet_xz, state.foot.flat),
            **named("clearance", LEGS, state.clearance),
            **named("torque", JOINTS, state.torque),
            **named("contact_force", feet_tn, state.contact_force.flat),
            **named("push", "xz", state.push),
            **named("contact", LEGS, state.contact),
            **named("penetrating", LINKS, [link in state.penetrating for link in LINKS]),
        },
        "/control": {
            **named("observation.q", COORDINATES, seen.q),
            **named("observation.dq", COORDINATES, seen.dq),
            **named("observation.contact", LEGS, seen.contact),
            **named("u_zd", JOINTS, step.u_zd),
            **named("u_mpc", JOINTS, step.u_mpc),
            **named("u_total", JOINTS, step.u_total),
            **named("y", OUTPUTS, step.y),
            **named("dy", OUTPUTS, step.dy),
            **named("contact_force", ("tangential", "normal"), step.contact_force),
            "theta": step.theta,
            "dtheta": step.dtheta,
            "s": step.s,
            "impact_in": step.impact_in,
            "stance": LEGS.index(step.stance),
            "fallback": step.fallback,
        },
        "/mpc": {
            **named("residual", ("primal", "dual", "gap"), step.residuals),
            "slack": step.slack,
            "iterations": step.iterations,
            "active": step.active,
            "status": STATUSES.index(step.status),
        },
        "/prediction/error": named(
            "contact_force",
            ("tangential", "normal"),
            force_error(k, state),
        ),
        "/timing": {"tick": tick_s(k), "solve": step.solve_s},
    }


def force_error(k, state):
    """Real minus expected contact force of the foot that tick k - 1 stood on."""
    if k == 0:
        return (0.0, 0.0)
    _, _, step = tick(k - 1)
    return state.contact_force[LEGS.index(step.stance)] - step.contact_force


def tick_s(k):
    return 1e-5 * (k + 1)


def write(path, ticks, header=HEADER, start=0):
    with Recorder(path, header, PERIOD) as recorder:
        for k in range(start, ticks):
            tell(recorder, k, *tick(k), tick_s(k))
            if k == 3:
                recorder.event(k, "info", "push", "push begins")
        recorder.result(SUMMARY)
    return path


def follow(message, dotted):
    for part in dotted.split("."):
        message = getattr(message, part)
    return message


TICKS = 431  # two full chunks and a part of one


@pytest.fixture(scope="module")
def log_path(tmp_path_factory):
    return write(tmp_path_factory.mktemp("log") / "run.mcap", TICKS)


def test_an_independent_decoder_reads_what_was_logged(log_path):
    wanted = [expected(k) for k in range(TICKS)]
    seen = {channel.topic: 0 for channel in CHANNELS}
    with open(log_path, "rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        for _, channel, message, decoded in reader.iter_decoded_messages(topics=list(seen)):
            k = seen[channel.topic]
            seen[channel.topic] += 1
            assert message.log_time == message.publish_time == k * 1_000_000
            assert message.sequence == k
            fields = wanted[k][channel.topic]
            assert {name: follow(decoded, name) for name in fields} == fields
    assert set(seen.values()) == {TICKS}


@pytest.mark.parametrize("topic", [channel.topic for channel in CHANNELS])
def test_structured_arrays_hold_the_same(log_path, topic):
    found = read_channel(log_path, topic)
    assert found["_time_ns"].tolist() == [k * 1_000_000 for k in range(TICKS)]
    for name in expected(0)[topic]:
        assert found[name].tolist() == [expected(k)[topic][name] for k in range(TICKS)], name


def test_the_table_has_no_field_the_tests_do_not_know():
    wanted = expected(0)
    for channel in CHANNELS:
        assert set(wanted[channel.topic]) == {f.name for f in channel.fields}


def test_stream_with_every_crc_matches_the_summary(log_path):
    counts: dict[int, int] = {}
    times = []
    with open(log_path, "rb") as file:
        for record in StreamReader(file, validate_crcs=True).records:
            if type(record).__name__ == "Message":
                counts[record.channel_id] = counts.get(record.channel_id, 0) + 1
                times.append(record.log_time)
            if isinstance(record, DataEnd):
                assert record.data_section_crc
    assert times == sorted(times)
    with open(log_path, "rb") as file:
        summary = make_reader(file).get_summary()
    assert summary.statistics.channel_message_counts == counts
    assert summary.statistics.message_count == len(times)
    assert summary.statistics.message_end_time == times[-1]
    assert len(summary.chunk_indexes) == summary.statistics.chunk_count
    assert {channel.topic for channel in summary.channels.values()} >= {c.topic for c in CHANNELS}


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_message_indexes_point_at_their_messages(log_path):
    """A seeking reader that starts in the middle finds the right ticks."""
    with open(log_path, "rb") as file:
        found = list(make_reader(file).iter_messages(["/control"], start_time=210_000_000, end_time=220_000_000))
    assert [message.sequence for _, _, message in found] == list(range(210, 220))


def test_units_are_in_the_channel_metadata(log_path):
    log = read_log(log_path)
    for channel in CHANNELS:
        assert log.units(channel.topic) == {f.name: f.unit for f in channel.fields}


def test_metadata_and_attachments_tell_the_whole_run(log_path):
    log = read_log(log_path)
    assert log.complete
    run = log.metadata["run"]
    assert (run["scenario"], run["seed"], run["git_revision"], run["git_dirty"]) == (
        "push-25N",
        "3",
        "0123abcd",
        "true",
    )
    assert json.loads(run["versions"]) == HEADER.versions
    assert run["started"] == HEADER.started
    assert log.metadata["result"]["outcome"] == "completed"
    assert json.loads(log.metadata["result"]["peak_torque_Nm"])["left_hip"] == 50.0
    assert json.loads(log.metadata["result"]["step_length_m"]) is None
    assert log.attachments == {
        "scenario.toml": ("application/toml", b"seed = 3\n"),
        **HEADER.attachments,
    }
    with open(log_path, "rb") as file:
        reader = make_reader(file)
        assert {a.name: a.data for a in reader.iter_attachments() if a.data} == {
            "scenario.toml": b"seed = 3\n",
            "rabbit.xml": b"<mujoco/>",
        }
        assert [m.name for m in reader.iter_metadata()] == ["run", "result"]


def test_events_begin_with_the_run_and_carry_their_time(log_path):
    events = read_log(log_path).messages("/events")
    assert events[0][0] == 0
    assert events[0][1].message.startswith("scenario push-25N, seed 3")
    assert (events[1][0], events[1][1].name, events[1][1].timestamp.nanos) == (3_000_000, "push", 3_000_000)


def test_an_unlisted_status_is_told_once(tmp_path):
    path = tmp_path / "run.mcap"
    with Recorder(path, HEADER, PERIOD) as recorder:
        for k in range(5):
            state, seen, step = tick(k)
            tell(recorder, k, state, seen, replace(step, status="the solver sulked"), 0.0)
    log = read_log(path)
    assert log.channel("/mpc")["status"].tolist() == [STATUSES.index("other")] * 5
    assert [e.message for _, e in log.messages("/events") if e.name == "status"] == [
        'status "the solver sulked" is logged as "other"'
    ]


def test_frames_follow_the_links(log_path):
    log = read_log(log_path)
    frames = log.messages("/tf")
    assert 50 <= len(frames) / (TICKS * PERIOD) <= 62
    time_ns, message = frames[1]
    state, _, _ = tick(time_ns // 1_000_000)
    by_name = {t.child_frame_id: t for t in message.transforms}
    assert set(by_name) == set(LINKS)
    femur = state.q[COORDINATES.index("torso")] + state.q[COORDINATES.index("right_hip")]
    knee = by_name["right_tibia"].translation
    assert knee.x == pytest.approx(state.hip[0] - 0.4 * sin(femur))
    assert knee.z == pytest.approx(state.hip[1] + 0.4 * cos(femur))
    turn = by_name["right_femur"].rotation
    along = (2 * turn.w * turn.y, 1 - 2 * turn.y**2)  # z axis of the frame, (x, z)
    assert along == pytest.approx((-sin(femur), cos(femur)))


def test_scene_is_drawn_once_in_the_link_frames(log_path):
    ((time_ns, scene),) = read_log(log_path).messages("/scene")
    assert time_ns == 0
    assert [(e.id, e.frame_id, e.frame_locked) for e in scene.entities] == [
        *((link, link, True) for link in LINKS),
        ("ground", "world", True),
    ]


def test_same_run_twice_gives_the_same_bytes_in_every_channel_but_timing(tmp_path):
    one = read_log(write(tmp_path / "a.mcap", 250))
    later = replace(HEADER, started="2024-02-02T22:22:22+00:00", platform="Linux 2")
    with Recorder(tmp_path / "b.mcap", later, PERIOD) as recorder:
        for k in range(250):
            state, seen, step = tick(k)
            tell(recorder, k, state, seen, replace(step, solve_s=9.0), 7.0)
            if k == 3:
                recorder.event(k, "info", "push", "push begins")
    two = read_log(tmp_path / "b.mcap")
    assert set(one.channels) == set(two.channels)
    for topic in one.channels:
        assert (one.records(topic) == two.records(topic)) == (topic != "/timing"), topic


def test_same_everything_gives_the_same_file(tmp_path):
    assert write(tmp_path / "a.mcap", 250).read_bytes() == write(tmp_path / "b.mcap", 250).read_bytes()


def test_live_views_are_copied(tmp_path):
    state, seen, step = tick(0)
    with Recorder(tmp_path / "run.mcap", HEADER, PERIOD) as recorder:
        tell(recorder, 0, state, seen, step, 0.0)
        state.q[:] = 0.0
    assert read_channel(tmp_path / "run.mcap", "/plant/state")["q.left_hip"][0] == tick(0)[0].q[0]


def test_an_exception_in_mid_run_leaves_a_finished_log(tmp_path):
    path = tmp_path / "run.mcap"
    with pytest.raises(ZeroDivisionError), Recorder(path, HEADER, PERIOD) as recorder:
        for k in range(321):
            tell(recorder, k, *tick(k), 0.0)
        raise ZeroDivisionError("boom")
    log = read_log(path)
    assert log.complete
    assert len(log.channel("/control")) == 321
    assert log.messages("/events")[-1][1].message == "ZeroDivisionError: boom"
    with open(path, "rb") as file:
        assert make_reader(file, validate_crcs=True).get_summary().statistics.message_end_time == 320_000_000


def test_a_killed_run_loses_at_most_one_chunk(tmp_path):
    path = tmp_path / "run.mcap"
    code = (
        "import itertools, sys; from tests.test_recorder import *\n"
        f"recorder = Recorder({str(path)!r}, HEADER, PERIOD)\n"
        "for k in itertools.count():\n"
        "    tell(recorder, k, *tick(k), 0.0)\n"
        "    if k == 777: print('ready', flush=True); sys.stdin.read()\n"
    )
    child = subprocess.Popen(
        [sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=ROOT
    )
    assert child.stdout.readline() == "ready\n"
    child.send_signal(signal.SIGKILL)
    child.communicate()
    log = read_log(path)
    assert not log.complete
    assert len(log.channel("/control")) >= 778 - 200
    assert log.channel("/control")["theta"][5] == expected(5)["/control"]["theta"]
    assert "run" in log.metadata and "rabbit.xml" in log.attachments


@pytest.mark.parametrize("fraction", [0.2, 0.5, 0.9, 0.999])
def test_a_truncated_log_gives_all_before_the_cut(log_path, tmp_path, fraction):
    data = log_path.read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(data[: int(fraction * len(data))])
    log = read_log(cut)
    assert not log.complete
    whole = read_channel(log_path, "/control")
    part = log.channel("/control")
    assert part.tobytes() == whole[: len(part)].tobytes()


def test_a_damaged_log_is_reported(log_path, tmp_path):
    data = bytearray(log_path.read_bytes())
    with open(log_path, "rb") as file:
        chunk = make_reader(file).get_summary().chunk_indexes[1]
    data[chunk.chunk_start_offset + chunk.chunk_length // 2] ^= 1
    (tmp_path / "bad.mcap").write_bytes(data)
    with pytest.raises(UserError, match="damaged at byte"):
        read_log(tmp_path / "bad.mcap")


def test_an_existing_file_is_refused_and_kept(tmp_path):
    path = tmp_path / "run.mcap"
    path.write_bytes(b"precious")
    with pytest.raises(UserError, match=r"run\.mcap exists already"):
        Recorder(path, HEADER, PERIOD)
    assert path.read_bytes() == b"precious"


def test_an_unwritable_path_is_named(tmp_path):
    path = tmp_path / "nowhere" / "run.mcap"
    with pytest.raises(UserError, match=r"nowhere/run\.mcap: No such file or directory"):
        Recorder(path, HEADER, PERIOD)


def test_a_full_disk_is_an_error_and_leaves_what_was_written(tmp_path):
    """A file size limit stands in for the disk; the summary finds the room the cut-off chunk leaves."""
    path = tmp_path / "run.mcap"
    code = (
        "import resource; from tests.test_recorder import *\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (450_000, 450_000))\n"
        "try:\n"
        f"    write({str(path)!r}, 5000)\n"
        "except UserError as error:\n"
        "    print(error)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert f"cannot write log {path}: File too large" in done.stdout
    log = read_log(path)
    assert log.complete
    assert len(log.channel("/control")) >= 200
    assert os.path.getsize(path) <= 450_000


def test_closing_twice_is_harmless(tmp_path):
    recorder = Recorder(tmp_path / "run.mcap", HEADER, PERIOD)
    recorder.close()
    recorder.close()
    assert read_log(tmp_path / "run.mcap").complete


def test_no_ticks_is_a_valid_log(tmp_path):
    path = write(tmp_path / "run.mcap", 0)
    assert len(read_channel(path, "/control")) == 0
    with open(path, "rb") as file:
        assert make_reader(file, validate_crcs=True).get_summary().statistics.message_count == 2


def test_attachment_crc_is_checked(log_path, tmp_path):
    data = log_path.read_bytes()
    (tmp_path / "bad.mcap").write_bytes(data.replace(b"<mujoco/>", b"<mujoco?>", 1))
    with pytest.raises(UserError, match="CRC of an attachment"):
        read_log(tmp_path / "bad.mcap")


def test_a_link_without_length_is_refused():
    with pytest.raises(ValueError, match="torso"):
        replace(HEADER, link_lengths={})


def test_a_directory_without_git_has_no_revision(tmp_path):
    state = git_state(tmp_path)
    assert state.revision is None and state.dirty is None


def test_versions_come_without_importing_the_packages():
    code = (
        "import sys, sim.log.provenance as p; v = p.package_versions(); p.git_state(); p.platform_name()\n"
        "assert 'numpy' in v, v\n"
        "assert not {'mujoco', 'pinocchio', 'numba', 'qpsolvers'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True, cwd=ROOT)
    assert package_versions()["mcap"]
