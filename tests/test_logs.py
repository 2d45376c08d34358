"""What `cmpc log` and `sim.review.load` say of sound, truncated, damaged and hostile logs."""

import csv
import json
import struct
import zlib

import numpy as np
import pytest
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Channel, Chunk, Message
from mcap.writer import MCAP0_MAGIC

from sim.bridge.run import run_scenario
from sim.cli import main
from sim.errors import UserError
from sim.log.format.fields import CHANNELS, PREDICTION
from sim.log.format.schema import SCHEMA, channel_metadata, full_name
from sim.log.read import read_log, salvage
from sim.log.read.attachments import check_xml
from sim.log.read.scan import scan
from sim.log.tools.compare import compare
from sim.log.write.container import McapFile
from sim.review import load
from sim.scenario import load as load_scenario
from sim.scenario import with_values
from tests.log_mutations import Parts

QUICK = {"time_limit": 0.45, "controller.horizon": 20}


def run(path, name="push-40N-first", **changes):
    run_scenario(with_values(load_scenario(name), QUICK | changes), log=path)
    return path


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return run(tmp_path_factory.mktemp("logs") / "run.mcap")


def cmpc(capsys, *words):
    code = main([str(word) for word in words])
    out = capsys.readouterr()
    return code, out.out, out.err


def test_frames_have_every_tick_with_units(path):
    loaded = load(path)
    control = loaded["/control"]
    assert control.tick.tolist() == list(range(450))
    assert control.t == pytest.approx(np.arange(450) * 1e-3)
    assert control["theta"].tolist() == read_log(path).channel("/control")["theta"].tolist()
    assert (control.units["u_total.left_hip"], control.units["fallback"]) == ("N.m", "")
    assert loaded["/plant/state"].units["contact_force.left.normal"] == "N"
    assert loaded["/prediction"].units["y.swing_knee[4]"] == "rad"
    assert loaded["/mpc"].enums["status"][2] == "OPTIMAL"
    assert loaded.result["outcome"] == "fell" and loaded.events[1].name == "push"
    with pytest.raises(UserError, match="no column 'thet'"):
        control["thet"]


def test_info_names_scenario_outcome_and_rates(path, capsys):
    code, out, _ = cmpc(capsys, "log", "info", path, "--json")
    facts = json.loads(out)
    assert code == 0 and facts["run"]["scenario"] == "push-40N-first" and facts["result"]["outcome"] == "fell"
    assert facts["channels"]["/control"] == {"schema": "cmpc.Control", "messages": 450, "rate_Hz": pytest.approx(1e3)}
    code, out, _ = cmpc(capsys, "log", "info", path)
    assert code == 0 and "push-40N-first" in out and "1000.0" in out


def test_check_passes_a_sound_log(path, capsys):
    code, out, _ = cmpc(capsys, "log", "check", path)
    assert code == 0 and "sound" in out


def test_check_finds_a_gap_and_a_wrong_statistic(path, tmp_path, capsys):
    """Records are left out and every CRC is right: only a look at the data tells."""
    data = path.read_bytes()
    with open(path, "rb") as file:
        second = make_reader(file).get_summary().chunk_indexes[1]
    end = second.chunk_start_offset + second.chunk_length + second.message_index_length
    without = data[: second.chunk_start_offset] + data[end:]
    (tmp_path / "gap.mcap").write_bytes(without)
    code, out, _ = cmpc(capsys, "log", "check", tmp_path / "gap.mcap")
    assert code == 1 and "/control lacks the ticks 200 to 399" in out and "statistics" in out


def test_check_tells_an_exchanged_attachment(path, tmp_path, capsys):
    code, out, _ = cmpc(capsys, "log", "check", exchanged(path, tmp_path / "x.mcap", "rabbit.xml", b"Units", b"units"))
    assert code == 1 and "rabbit.xml is not the one the run began with" in out


def exchanged(source, target, name, old, new):
    """The log with one attachment changed and every CRC right."""
    log = read_log(source)
    file = McapFile(target)
    for key, values in log.metadata.items():
        file.metadata(key, values)
    for key, (kind, content) in log.attachments.items():
        if key == name:
            assert old in content
            content = content.replace(old, new, 1)
        file.attachment(key, kind, content)
    ids = {
        channel.id: file.channel(
            topic, log.schemas[channel.schema_id].name, log.schemas[channel.schema_id].data, channel.metadata
        )
        for topic, channel in log.channels.items()
    }
    assert all(old_id == new_id for old_id, new_id in ids.items())
    for topic, channel in log.channels.items():
        records = log.records(topic)
        if records:
            sizes = np.cumsum([0] + [len(r) for r in records[:-1]])
            times = [int.from_bytes(r[15:23], "little") for r in records]
            file.chunk(b"".join(records), {channel.id: np.column_stack((times, sizes)).astype(np.uint64)})
    file.finish()
    return target


def test_recover_saves_all_whole_chunks_of_a_cut_log(path, tmp_path, capsys):
    data = path.read_bytes()
    data = data[: scan(data).end - 13]  # what comes after the data only repeats them
    for fraction in (0.5, 0.9, 0.99):
        cut, saved = tmp_path / f"{fraction}.mcap", tmp_path / f"{fraction}-saved.mcap"
        cut.write_bytes(data[: int(fraction * len(data))])
        code, out, _ = cmpc(capsys, "log", "recover", cut, saved)
        assert code == 1 and "lost: " in out
        log = read_log(saved)
        assert log.complete and len(log.channel("/control")) >= 200
        assert log.attachments == read_log(path).attachments
        with open(saved, "rb") as file:
            statistics = make_reader(file, validate_crcs=True).get_summary().statistics
        assert statistics.message_count == sum(len(log.records(topic)) for topic in log.channels)
        whole = read_log(path).channel("/control")
        assert log.channel("/control")["theta"].tolist() == whole["theta"][: len(log.channel("/control"))].tolist()


def test_recover_of_a_whole_log_loses_nothing(path, tmp_path, capsys):
    code, out, _ = cmpc(capsys, "log", "recover", path, tmp_path / "saved.mcap")
    assert code == 0 and "all there was" in out
    assert cmpc(capsys, "log", "compare", path, tmp_path / "saved.mcap")[0] == 0


def test_a_broken_length_costs_one_chunk(path, tmp_path):
    data = bytearray(path.read_bytes())
    with open(path, "rb") as file:
        second = make_reader(file).get_summary().chunk_indexes[1]
    data[second.chunk_start_offset + 4] ^= 0x40  # the record claims a gigabyte more
    (tmp_path / "bad.mcap").write_bytes(data)
    log = salvage(tmp_path / "bad.mcap")
    assert log.channel("/control")["_tick"].tolist() == [*range(200), *range(400, 450)]
    assert any("skipped" in text for _, text in log.problems)


def test_compare_names_the_first_difference(path, tmp_path, capsys):
    other = run(tmp_path / "b.mcap", **{"plant.ground.friction": 0.3})
    code, out, _ = cmpc(capsys, "log", "compare", path, other)
    assert code == 1 and "different: first at tick" in out and "attachment scenario.toml differs" in out
    a, b = read_log(path).channel("/plant/state"), read_log(other).channel("/plant/state")
    n = min(len(a), len(b))
    tick = min(
        int(np.argmax(a[name][:n] != b[name][:n])) or n for name in a.dtype.names if (a[name][:n] != b[name][:n]).any()
    )
    state = next(c for c in compare(read_log(path), read_log(other)).channels if c.topic == "/plant/state")
    assert state.first.tick == tick
    q = np.abs(a["q.torso"][:n] - b["q.torso"][:n]).max()
    assert state.largest["q.torso"] == pytest.approx(q)


def test_the_same_run_twice_compares_identical(path, tmp_path, capsys):
    code, out, _ = cmpc(capsys, "log", "compare", path, run(tmp_path / "again.mcap"))
    assert code == 0 and out.endswith("identical (wall times left out)\n")


def test_as_many_chunks_with_other_bounds_are_another_container(path, tmp_path):
    parts = Parts.of(path.read_bytes())
    logs = []
    for size in (300_000, 299_000):
        file = tmp_path / f"{size}.mcap"
        file.write_bytes(parts.write(chunk_size=size))
        logs.append(read_log(file))
    assert len(logs[0].chunks) == len(logs[1].chunks) and logs[0].chunks != logs[1].chunks
    assert compare(*logs).verdict == "same ticks, other container: chunks of other sizes"


def test_channels_of_one_topic_and_schema_are_saved_as_one(path, tmp_path, capsys):
    parts = Parts.of(path.read_bytes())
    for key in (900, 901):
        parts.channels[key] = Channel(id=key, topic="/camera", message_encoding="json", metadata={}, schema_id=0)
        parts.messages.append(Message(key, 10**8, b"{}", 0, 0))
    (tmp_path / "two.mcap").write_bytes(parts.write())
    code, out, _ = cmpc(capsys, "log", "recover", tmp_path / "two.mcap", tmp_path / "saved.mcap")
    assert code == 0 and "all there was" in out
    assert len(read_log(tmp_path / "saved.mcap").records("/camera")) == 2


def test_an_attachment_nested_deeper_than_python_is_no_gait_and_no_scenario(path, tmp_path, capsys):
    for number in range(2):
        parts = Parts.of(path.read_bytes())
        names = [name for name, _, _ in parts.attachments if name.endswith(".toml")]
        deep = ("seed = " + "[" * 5000 + "]" * 5000).encode()
        parts.attachments = [(n, k, deep if n == names[number] else c) for n, k, c in parts.attachments]
        bad = tmp_path / f"{number}.mcap"
        bad.write_bytes(parts.write())
        code, _, err = cmpc(capsys, "review", bad, "--no-open", "--out", tmp_path / "page.html")
        assert code == 0, err
        code, _, err = cmpc(capsys, "replay", bad, "--quiet")
        assert code == 2 and "Traceback" not in err and "nested too deeply" in err.splitlines()[-1]


@pytest.mark.parametrize("steps", ["nonsense", "[1]", "null", "1e400", "-3", "2.5"])
def test_a_result_that_counts_no_steps_is_still_told(path, tmp_path, capsys, steps):
    parts = Parts.of(path.read_bytes())
    parts.said("result").update(outcome='"fell"', steps=steps)
    (tmp_path / "odd.mcap").write_bytes(parts.write())
    code, out, err = cmpc(capsys, "log", "info", tmp_path / "odd.mcap")
    assert code == 0 and "fell" in out and not err
    assert cmpc(capsys, "log", "check", tmp_path / "odd.mcap")[0] == 1


def test_a_truncated_log_is_never_identical_to_itself(path, tmp_path, capsys):
    (tmp_path / "cut.mcap").write_bytes(path.read_bytes()[:-20])
    code, out, err = cmpc(capsys, "log", "compare", tmp_path / "cut.mcap", tmp_path / "cut.mcap")
    assert code == 1 and "no verdict" in out and "not finished" in err


@pytest.mark.parametrize("kind", ["csv", "parquet"])
def test_export_holds_the_same_numbers(path, tmp_path, capsys, kind):
    code, _, _ = cmpc(capsys, "log", "export", path, tmp_path / "out", "--format", kind)
    if kind == "parquet":
        parquet = pytest.importorskip("pyarrow.parquet")
        table = parquet.read_table(tmp_path / "out/control.parquet")
        theta = table["theta"].to_pylist()
        assert table.schema.field("theta").metadata[b"unit"] == b"rad"
    else:
        rows = list(csv.reader(open(tmp_path / "out/control.csv")))
        theta = [float(row[rows[0].index("theta [rad]")]) for row in rows[1:]]
        assert {row[rows[0].index("stance")] for row in rows[1:]} == {"LEFT", "RIGHT"}
    assert code == 0 and theta == read_log(path).channel("/control")["theta"].tolist()
    assert (tmp_path / "out/attachments/rabbit.xml").read_bytes() == read_log(path).attachments["rabbit.xml"][1]


def test_export_overwrites_nothing(path, tmp_path, capsys):
    assert cmpc(capsys, "log", "export", path, tmp_path / "out", "--channel", "/mpc")[0] == 0
    code, _, err = cmpc(capsys, "log", "export", path, tmp_path / "out", "--channel", "/mpc")
    assert code == 2 and "mpc.csv: exists already" in err
    code, _, err = cmpc(capsys, "log", "export", path, tmp_path / "out", "--channel", "/nope")
    assert code == 2 and "no frame '/nope'" in err


def hostile(path, attachments=(), topic="/control", note="x"):
    file = McapFile(path)
    file.metadata("run", {"scenario": note, "period_ns": note, "versions": note, "sha256": note, "link_lengths": note})
    for name, content in attachments:
        file.attachment(name, "text/plain", content)
    for channel in CHANNELS:
        file.channel(
            topic if channel.topic == "/control" else channel.topic,
            full_name(channel),
            SCHEMA,
            channel_metadata(channel),
        )
    file.channel(PREDICTION.topic, full_name(PREDICTION), SCHEMA, {"units": note})
    file.finish()
    return path


@pytest.mark.parametrize(
    "name", ["../../evil.txt", "/tmp/cmpc-evil.txt", "..", "a/../../b", "C:\\evil", ".bashrc", "\x1b[2Jx"]
)
def test_attachment_names_stay_inside_the_folder(tmp_path, capsys, name):
    path = hostile(tmp_path / "h.mcap", [(name, b"evil")], note="{}")
    inside = tmp_path / "deep/er/out"
    code, out, _ = cmpc(capsys, "log", "export", path, inside)
    assert code == 0 and "\x1b" not in out
    assert not (tmp_path / "evil.txt").exists() and not (tmp_path / "deep/evil.txt").exists()
    written = [p for p in tmp_path.rglob("*") if p.is_file() and p != path]
    assert written and all(p.is_relative_to(inside) for p in written)
    assert [p.read_bytes() for p in written if p.parent.name == "attachments"] == [b"evil"]


@pytest.mark.parametrize("action", ["info", "check"])
def test_escape_sequences_do_not_reach_the_terminal(tmp_path, capsys, action):
    path = hostile(tmp_path / "h.mcap", [("\x1b]0;owned\x07.xml", b"\x1b[31m")], topic="/\x1b[2J", note="\x1b[2J")
    _, out, err = cmpc(capsys, "log", action, path)
    assert "\x1b" not in out + err and "\x07" not in out + err


@pytest.mark.parametrize("word", ["replay", "review"])
def test_a_log_without_ticks_is_refused(tmp_path, capsys, word):
    path = hostile(tmp_path / "h.mcap", note="[" * 100_000)
    code, _, err = cmpc(capsys, word, path)
    assert code == 2 and err.count("\n") == 1


@pytest.mark.parametrize(
    "text",
    [
        b'<mujoco><include file="/etc/passwd"/></mujoco>',
        b'<!DOCTYPE x [<!ENTITY e SYSTEM "file:///etc/passwd">]><mujoco>&e;</mujoco>',
        b'<mujoco><asset><texture name="t" type="2d" file="/etc/passwd"/></asset></mujoco>',
        b'<mujoco><compiler meshdir="/"/></mujoco>',
        b'<robot><link name="a"><visual><geometry><mesh filename="package://x"/></geometry></visual></link></robot>',
        b'<mujoco><asset><texture builtin="flat" width="1000000000" height="9"/></asset></mujoco>',
        b'<mujoco><worldbody><replicate count="1000000000"/></worldbody></mujoco>',
        b"<a>" * 1000 + b"</a>" * 1000,
        b"no xml",
    ],
)
def test_models_that_reach_out_are_refused(text):
    with pytest.raises(UserError):
        check_xml("model.xml", text)


def test_a_chunk_that_unpacks_to_gigabytes_is_refused(tmp_path):
    bomb = zstandard.ZstdCompressor(level=1, write_content_size=False).compress(bytes(80 * 2**20))
    for claimed in (2**20, 2**40):
        chunk = Chunk("zstd", bomb, 0, 0, 0, claimed)
        builder = RecordBuilder()
        chunk.write(builder)
        (tmp_path / "bomb.mcap").write_bytes(MCAP0_MAGIC + builder.end())
        with pytest.raises(UserError, match="damaged"):
            read_log(tmp_path / "bomb.mcap")


def test_a_record_may_claim_any_length(tmp_path):
    claim = struct.pack("<BQ", Opcode.ATTACHMENT, 2**63) + b"x" * 100
    (tmp_path / "long.mcap").write_bytes(MCAP0_MAGIC + claim)
    assert not read_log(tmp_path / "long.mcap").complete


def test_the_data_crc_covers_what_has_no_crc_of_its_own(path, tmp_path):
    data = path.read_bytes()
    at = data.index(b"push-40N-first")
    (tmp_path / "bad.mcap").write_bytes(data[:at] + b"P" + data[at + 1 :])
    with pytest.raises(UserError, match="CRC of the data section"):
        read_log(tmp_path / "bad.mcap")
    assert zlib.crc32(data) != zlib.crc32((tmp_path / "bad.mcap").read_bytes())


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["log", "chek", "x"], "did you mean check? must be info, check"),
        (["log", "info"], "required: LOG"),
        (["log", "info", "nowhere.mcap"], "nowhere.mcap: No such file"),
        (["log", "info", "/dev/zero"], "not a file"),
        (["log", "info", "pyproject.toml"], "not an MCAP file"),
        (["review", "a", "b", "c"], "one log or two"),
        (["replay", "nowhere.mcap"], "nowhere.mcap"),
        (["video", "nowhere.mcap", "x.mp4"], "nowhere.mcap"),
    ],
)
def test_bad_input_is_one_line(capsys, words, message):
    code, _, err = cmpc(capsys, *words)
    assert code == 2 and message in err and err.count("\n") == 1 and err.startswith("cmpc: error: ")
