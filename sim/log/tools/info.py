"""What a log is about: the run, its end, its channels."""

from typing import Any

from rich.table import Table
from rich.text import Text

from sim.log.read import Log
from sim.log.read.frames import parsed, run_of
from sim.log.tools.signed import is_signed
from sim.log.tools.text import printable

_ABOUT = (
    "scenario",
    "seed",
    "started",
    "versions",
    "git_revision",
    "git_dirty",
    "platform",
    "cpu",
    "blas",
    "kernels",
    "period_ns",
    "format",
)
_RESULT = ("outcome", "fall_reason", "message", "steps", "time_s", "step_time_s", "step_length_m")


def facts(log: Log) -> dict[str, Any]:
    """Everything as one plain object."""
    channels = {}
    end = 0.0
    for topic, channel in log.channels.items():
        records = log.records(topic)
        times = [int.from_bytes(record[15:23], "little") * 1e-9 for record in records[:1] + records[-1:]]
        duration = times[-1] - times[0] if times else 0.0
        end = max(end, times[-1] if times else 0.0)
        schema = log.schemas.get(channel.schema_id)
        channels[topic] = {
            "schema": schema.name if schema else "missing",
            "messages": len(records),
            "rate_Hz": (len(records) - 1) / duration if duration > 0 else None,
        }
    return {
        "log": str(log.path),
        "complete": log.complete,
        "problems": [f"byte {at}: {text}" for at, text in log.problems],
        "duration_s": end,
        "run": {key: parsed(log.metadata.get("run", {}).get(key, "")) for key in _ABOUT},
        "signed": is_signed(log),
        "result": run_of(log).result,
        "channels": channels,
        "foreign": log.foreign,
        "attachments": {name: len(data) for name, (_, data) in log.attachments.items()},
        "recovery": log.metadata.get("recovery"),
    }


def as_table(log: Log) -> list[Table]:
    """The same for people: facts, then channels."""
    found = facts(log)
    about = Table(show_header=False, title=Text(printable(log.path.name)), title_justify="left")
    about.add_column(style="dim", no_wrap=True)
    about.add_column(overflow="fold")

    def row(name: str, value: Any) -> None:
        if value not in ("", None):
            words = ", ".join(f"{k} {v}" for k, v in value.items()) if isinstance(value, dict) else value
            about.add_row(Text(name.replace("_", " ")), Text(printable(words, 600)))

    if log.problems:
        row("damage", "; ".join(found["problems"]))
    row("finished", "yes" if log.complete else "no: the run was killed, or the file is cut off")
    row("duration", f"{found['duration_s']:.3f} s")
    row("result", "signed" if found["signed"] else "unsigned" if found["result"] else "")
    for key in _ABOUT:
        row(key, found["run"][key])
    for key in _RESULT:
        row(key, found["result"].get(key))
    row("attachments", ", ".join(f"{name} ({size} bytes)" for name, size in found["attachments"].items()))
    row("recovered", (found["recovery"] or {}).get("lost"))

    channels = Table(title="channels", title_justify="left")
    for name, side in (("topic", "left"), ("messages", "right"), ("rate [Hz]", "right"), ("schema", "left")):
        channels.add_column(name, justify=side)  # type: ignore[arg-type]
    for topic, one in found["channels"].items():
        rate = f"{one['rate_Hz']:.1f}" if one["rate_Hz"] else ""
        kind = printable(one["schema"]) + (" (foreign)" if topic in found["foreign"] else "")
        channels.add_row(Text(printable(topic)), str(one["messages"]), rate, Text(kind))
    return [about, channels]
