"""Seeded mutations of the files people write: URDF, MJCF, xacro, gaits, scenarios, plans.

    python tests/fuzz.py [--count 2000] [--seed 0] [--workers 2] [--kinds plan ...]

A part of the 2,000: `--seed 256 --count 256`, multiples of the number of kinds; `--kinds` leaves the others out.
Each mutated file goes through the command that reads it, in a forked process with 2 GB and 60 s of processor time.
Legal are exit code 0 (1 for a check that fails), and exit code 2 with one line of ours on stderr and nothing of any
parser's. Everything else is printed with the kind and seed that make it again, and the exit code is 1.
"""

import argparse
import collections
import contextlib
import io
import os
import random
import re
import resource
import signal
import subprocess
import sys
import tempfile
import traceback
from collections.abc import Sequence
from pathlib import Path

if __name__ == "__main__":
    for threads in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"):
        os.environ.setdefault(threads, "1")

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(Path(__file__).parent))

sys.path.insert(0, str(ROOT))

import robots  # noqa: E402
from spoken import spoken  # noqa: E402

from sim import cli  # noqa: E402
from sim.runner.nursery import nursery  # noqa: E402

SECONDS, MEMORY = 60, 2 << 30  # [s] of processor time, [B]
LATEST = 20 * SECONDS  # [s] of wall time, on a busy machine
LATE = f"more than {SECONDS} s, or {LATEST} s of wall time"
RABBIT = ROOT / "models" / "rabbit"
KINDS = ("urdf", "mjcf", "xacro", "gait", "scenario", "plan", "plant", "import")

PLAN = """\
name = "small"
description = "two trials"
seed = 7
controllers = ["zd-pd"]

[scenario]
steps = 1
time_limit = 0.02

[[montecarlo]]
name = "push"
trials = 2

[[montecarlo.axes]]
name = "push on torso"
paths = ["pushes.0.force"]
also = ["pushes.0.step = 1"]
distribution = "uniform"
low = 40.0
high = 90.0
"""
WORDS = (
    "",
    "0",
    "-1",
    "1e308",
    "nan",
    "inf",
    "-0.0",
    "1e-300",
    "true",
    "x",
    "0 0 0",
    "999999999999",
    "é",
    "&",
    "[]",
    '"',
)


def seeds() -> dict[str, str]:
    """An unmutated file of each kind."""
    scenario = (ROOT / "sim" / "scenario" / "shipped" / "undisturbed.toml").read_text(encoding="utf-8")
    return {
        "urdf": robots.urdf(**robots.OPTIMISER),
        "mjcf": robots.mjcf(),
        "xacro": robots.XACRO,
        "gait": (RABBIT / "gaits" / "paper.toml").read_text(encoding="utf-8"),
        "scenario": scenario,
        "plan": PLAN,
        "plant": (RABBIT / "rabbit.xml").read_text(encoding="utf-8"),
        "import": "t,left_hip,left_knee,right_hip,right_knee,torso\n"
        + "".join(f"{0.03 * k},{3.5 - 0.04 * k},-0.3,{2.9 + 0.04 * k},-0.2,0.02\n" for k in range(16)),
    }


def mutate(text: str, rng: random.Random) -> str:
    """One to three small changes: numbers, words, lines and pieces of the file."""
    for _ in range(rng.randint(1, 3)):
        what = rng.randrange(7)
        if what <= 2:
            found = list(re.finditer(r"-?\d+\.?\d*(?:e-?\d+)?", text))
            if found:
                at = rng.choice(found)
                new = rng.choice((*WORDS, str(float(at.group()) * rng.choice((-1, 0, 1e-3, 1e3, 1.01)))))
                text = text[: at.start()] + new + text[at.end() :]
        elif what == 3:
            found = list(re.finditer(r'"[^"\n]*"', text))
            if found:
                at = rng.choice(found)
                text = text[: at.start()] + f'"{rng.choice(WORDS)}"' + text[at.end() :]
        elif what == 4:
            lines = re.split(r"(?<=>)|\n", text)
            del lines[rng.randrange(len(lines))]
            text = "\n".join(lines)
        elif what == 5:
            lines = re.split(r"(?<=>)|\n", text)
            i, j = rng.randrange(len(lines)), rng.randrange(len(lines))
            lines.insert(j, lines[i])
            text = "\n".join(lines)
        else:
            i = rng.randrange(max(len(text), 1))
            text = (
                text[:i] + rng.choice(("", text[i : i + 1] * 2, "\0", "<", "}", "\n")) + text[i + rng.randint(0, 3) :]
            )
    return text


def command(kind: str, folder: Path, text: str) -> list[str]:
    """Write the file where the command finds it; the command that reads it."""
    short = ["--time-limit", "0.02", "--no-log", "--quiet"]
    if kind in ("urdf", "mjcf", "xacro"):
        file = folder / f"robot.{'xml' if kind == 'mjcf' else kind}"
        file.write_text(text, encoding="utf-8")
        given = ["--torque", "75", "50", "--tibia-length", "0.4"] if kind == "urdf" else []
        return ["walker", "new", str(folder / "made"), f"--{kind}", str(file), *given]
    if kind == "gait":
        (folder / "g.toml").write_text(text, encoding="utf-8")
        return ["run", "undisturbed", "--controller", "zd-pd", "--gait", str(folder / "g.toml"), *short]
    if kind == "scenario":
        (folder / "s.toml").write_text(text, encoding="utf-8")
        return ["run", str(folder / "s.toml"), *short]
    if kind == "plan":
        (folder / "p.toml").write_text(text, encoding="utf-8")
        return ["trials", str(folder / "p.toml"), "--out", str(folder / "out"), "--workers", "1", "--quiet"]
    if kind == "import":
        (folder / "i.csv").write_text(text, encoding="utf-8")
        return ["gait", "import", str(folder / "i.csv"), "--out", str(folder / "o.toml")]
    walker = folder / "walker"
    (walker / "gaits").mkdir(parents=True)
    (walker / "walker.xml").write_text(text, encoding="utf-8")
    (walker / "walker.urdf").write_bytes((RABBIT / "rabbit.urdf").read_bytes())
    (walker / "gaits" / "g.toml").write_bytes((RABBIT / "gaits" / "paper.toml").read_bytes())
    flags = ["--controller", "zd-pd", "--gait", "g", *short]
    return ["run", "undisturbed", "--walker", str(walker), *flags]


def child(argv: list[str], out: str, err: str) -> None:
    """Become the command: its output in files, its memory bounded; never returns."""
    for descriptor, path in ((1, out), (2, err)):
        os.dup2(os.open(path, os.O_WRONLY | os.O_CREAT, 0o600), descriptor)
    signal.alarm(LATEST)
    resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS + 5))
    held = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (held + MEMORY, held + MEMORY))
    code = 70
    try:
        code = cli.main(argv)
    except SystemExit as stopped:
        code = stopped.code if isinstance(stopped.code, int) else 70
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def verdict(code: int, err: str) -> str:
    """What is wrong with an outcome, empty for nothing."""
    if "Traceback" in err or code not in (0, 1, 2):
        return f"exit code {code}"
    lines = spoken(err)
    if code == 2 and not (len(lines) == 1 and lines[0].startswith("cmpc: error:")):
        return f"{len(lines)} lines"
    foreign = [line for line in lines if code != 2 and not line.startswith("cmpc: ") and "rad" not in line]
    return f"a line of another's: {foreign[0][:80]}" if foreign else ""


def mutated(kind: str, seed: int) -> str:
    """A file of a kind with the mistakes of a seed."""
    return mutate(seeds()[kind], random.Random(f"{kind}-{seed}"))


def start(kind: str, text: str) -> tuple[int, tempfile.TemporaryDirectory]:
    """Fork the command that reads a text; its process and its folder."""
    folder = tempfile.TemporaryDirectory(prefix="cmpc-fuzz-")
    argv = command(kind, Path(folder.name), text)
    sys.stdout.flush()
    process = os.fork()
    if not process:
        child(argv, f"{folder.name}/.stdout", f"{folder.name}/.stderr")
    return process, folder


def outcome(status: int, folder: str) -> tuple[str, str, str]:
    """What is wrong with a command that has ended, its exit code, and its last line."""
    if os.WIFSIGNALED(status):
        number = os.WTERMSIG(status)
        return (LATE if number in (signal.SIGALRM, signal.SIGXCPU) else f"killed by signal {number}"), "-", ""
    code, err = os.WEXITSTATUS(status), Path(folder, ".stderr").read_text(encoding="utf-8", errors="replace")
    last = (err.strip().splitlines() or [""])[-1]
    return verdict(code, err), str(code), last.replace(folder, "...")


def alone(kind: str, seed: int) -> tuple[str, str, str]:
    """The same in a process of its own."""
    with tempfile.TemporaryDirectory(prefix="cmpc-fuzz-") as name:
        argv = [sys.executable, "-m", "sim", *command(kind, Path(name), mutated(kind, seed))]
        try:
            done = subprocess.run(argv, capture_output=True, timeout=LATEST, cwd=ROOT, check=False)
        except subprocess.TimeoutExpired:
            return LATE, "-", ""
        err = done.stderr.decode(errors="replace")
        last = (err.strip().splitlines() or [""])[-1]
        return verdict(done.returncode, err), str(done.returncode), last.replace(name, "...")


def warm(kinds: Sequence[str]) -> None:
    """Import and compile before forking, by the files as they are."""
    for kind in kinds:
        with tempfile.TemporaryDirectory() as name, contextlib.redirect_stdout(io.StringIO()):
            cli.main(command(kind, Path(name), seeds()[kind]))
    nursery().close()  # workers of a campaign belong to the process that runs it
    for kind in kinds:
        process, folder = start(kind, seeds()[kind])
        with folder:
            _, code, last = outcome(os.waitpid(process, 0)[1], folder.name)
        if code not in ("0", "1"):
            raise SystemExit(f"the {kind} as it is ends with exit code {code}: {last}")


def main() -> int:
    """Run them all; 0 if all of them are legal."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=KINDS)
    found = parser.parse_args()
    jobs = [(KINDS[i % len(KINDS)], found.seed + i) for i in range(found.count)]
    jobs = [(kind, seed) for kind, seed in jobs if kind in found.kinds]
    codes: collections.Counter[str] = collections.Counter()
    wrong = 0
    warm(found.kinds)
    running: dict[int, tuple[str, int, tempfile.TemporaryDirectory]] = {}
    while jobs or running:
        while jobs and len(running) < found.workers:
            kind, seed = jobs.pop(0)
            process, folder = start(kind, mutated(kind, seed))
            running[process] = (kind, seed, folder)
        process, status = os.wait()
        kind, seed, folder = running.pop(process)
        what, code, last = outcome(status, folder.name)
        if what == LATE:  # a fork may inherit a lock of a library's threads: what counts is a process of its own
            what, code, last = alone(kind, seed)
        folder.cleanup()
        codes[f"{kind} {code}"] += 1
        if what:
            wrong += 1
            print(f"{kind} {seed}: {what}: {last[:160]}", flush=True)
    print(f"{codes.total()} mutations, {wrong} wrong; by kind and exit code: {dict(sorted(codes.items()))}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
