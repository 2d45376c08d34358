"""Ctrl-C at 40 random moments of 10 commands: how fast each ends, with how many lines, and what it leaves behind.

`make interrupts`; a seed as the argument gives other moments. Kernels must lie on disk: the first compile is a matter
of its own (`tests/test_compiled.py`).
"""

import os
import random
import signal
import subprocess
import sys
import tempfile
import time
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LIMIT = 2.0  # [s]
MOMENTS = 40
EARLIEST = 0.3  # [s]; before, the interpreter itself starts
CODES = {130, 0, 1}  # interrupted, or done before the signal came

PLAN = """
controllers = ["c-mpc", "zd-pd"]
[scenario]
steps = 10
[[grid]]
[[grid.axes]]
paths = ["pushes.0.force"]
also = ["pushes.0.step = 2"]
low = 5.0
high = 50.0
count = 40
"""

COMMANDS = (
    ("run undisturbed --steps 400 --log run.mcap", 6.0),
    ("run undisturbed --controller c-mpc-ltv --steps 100 --log ltv.mcap", 8.0),
    ("trials plan.toml --out campaign", 10.0),
    ("reproduce fig3 --quick --out reproduced", 8.0),
    ("poincare --controller zd-pd --plant.kind rigid", 6.0),
    ("gait design --step-length 0.4 --speed 0.8 --out made.toml", 6.0),
    ("gait check paper", 3.0),
    ("review RUN.mcap --out page.html --no-open", 3.0),
    ("replay RUN.mcap", 3.0),
    ("bench --quick", 10.0),
)
"""Words, and the time in [s] within which the signal comes."""


def left_behind(folder: Path, known: set[str]) -> list[str]:
    """What is not whole among the files that a command left."""
    from sim.log.read import read_log

    wrong = []
    for path in sorted(path for path in folder.rglob("*") if path.is_file() and path.name not in known):
        try:
            if path.suffix == ".mcap":
                log = read_log(path)
                assert log.complete and "result" in log.metadata
            elif path.suffix == ".toml":
                tomllib.loads(path.read_text())
            elif path.suffix == ".html":
                assert path.read_text().rstrip().endswith("</html>")
            else:
                assert not path.name.startswith((".", "tmp")) or path.name == ".lock"
        except Exception as error:
            wrong.append(f"{path.relative_to(folder)}: {error!r}")
    return wrong


def interrupted(folder: Path, words: str, delay: float) -> tuple[float, list[str]]:
    """Run a command, interrupt it after a delay in [s]; seconds it took to end, and all that is wrong."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    known = {path.name for path in folder.iterdir()}
    command = [sys.executable, "-m", "sim", *words.split()]
    process = subprocess.Popen(
        command, cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    time.sleep(delay)
    done_before = process.poll() is not None
    process.send_signal(signal.SIGINT)
    began = time.perf_counter()
    try:
        _, err = process.communicate(timeout=60)
    except subprocess.TimeoutExpired:
        process.kill()
        return 60.0, ["alive a minute later"]
    took = time.perf_counter() - began
    wrong = left_behind(folder, known)
    if "Traceback" in err or "Error" in err or "Warning" in err:
        wrong.append(err[-600:])
    if process.returncode not in CODES:
        wrong.append(f"exit code {process.returncode}: {err[-300:]}")
    told = [line for line in err.splitlines() if "interrupt" in line or "stopped" in line]
    if process.returncode == 130 and len(told) > 1:
        wrong.append(f"{len(told)} lines: {told}")
    return took, [*wrong, *(["done before"] if done_before else [])]


def main() -> None:
    """Interrupt; exit code 1 if anything was wrong."""
    sys.path.insert(0, str(ROOT))
    rng = random.Random(int(sys.argv[1]) if sys.argv[1:] else 0)
    failed, slowest = 0, 0.0
    with tempfile.TemporaryDirectory() as top:
        stock = Path(top) / "RUN.mcap"
        words = ["run", "undisturbed", "--steps", "60", "--controller", "zd-pd", "--quiet", "--log", str(stock)]
        environment = {**os.environ, "PYTHONPATH": str(ROOT)}
        subprocess.run([sys.executable, "-m", "sim", *words], env=environment, check=True, stdout=subprocess.DEVNULL)
        for number in range(MOMENTS):
            command, span = COMMANDS[number % len(COMMANDS)]
            folder = Path(top) / str(number)
            folder.mkdir()
            (folder / "RUN.mcap").symlink_to(stock)
            (folder / "plan.toml").write_text(PLAN)
            delay = rng.uniform(EARLIEST, span)
            took, wrong = interrupted(folder, command, delay)
            over = "done before" in wrong
            wrong = [words for words in wrong if words != "done before"]
            bad = bool(wrong) or took > LIMIT
            failed += bad
            slowest = max(slowest, took)
            state = "FAIL" if bad else "over" if over else "ok  "
            print(f"{state} {command.split(' --')[0]:<24} at {delay:5.2f} s: ended in {took:5.2f} s", flush=True)
            for line in wrong:
                print("     ", line)
    print(f"{failed} of {MOMENTS} failed; slowest {slowest:.2f} s")
    sys.exit(bool(failed))


if __name__ == "__main__":
    main()
