"""The wheel alone in an empty folder: what it holds, and that it walks beside files that have our packages' names.

`make wheel` runs it. Everything but the wheel comes from the environment that runs it.
"""

import os
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
DIST = ROOT / "dist"

SCRIPT = """
import cmpc

summary = cmpc.run(cmpc.with_value(cmpc.load("undisturbed"), "steps", 1), controller="zd-pd", log="run.mcap")
print(summary.outcome, cmpc.__file__, __import__("sim").__file__)
"""


def main() -> None:
    """Build, install into a folder of its own, look, walk."""
    pip = [sys.executable, "-m", "pip", "-q", "--disable-pip-version-check"]
    for old in DIST.glob("*.whl"):
        old.unlink()
    subprocess.run([*pip, "wheel", "--no-deps", "-w", str(DIST), str(ROOT)], check=True)
    (wheel,) = DIST.glob("*.whl")
    names = set(zipfile.ZipFile(wheel).namelist())
    tops = {name.partition("/")[0] for name in names if ".dist-info" not in name}
    assert tops == {"cmpc.py", "controller", "sim"}, tops
    wanted = (
        "sim/py.typed",
        "controller/py.typed",
        "sim/models/rabbit/rabbit.urdf",
        "sim/scenario/shipped/push-25N.toml",
    )
    assert names.issuperset(wanted), set(wanted) - names
    about = zipfile.ZipFile(wheel).read(next(name for name in names if name.endswith("/METADATA"))).decode()
    for line in ("Author:", "Classifier: ", "Keywords: ", "License-Expression: Apache-2.0"):
        assert f"\n{line}" in about, line
    with tempfile.TemporaryDirectory() as folder:
        site, empty = Path(folder) / "site", Path(folder) / "empty"
        empty.mkdir()
        subprocess.run([*pip, "install", "--no-deps", "--target", str(site), str(wheel)], check=True)
        for name in ("sim.py", "controller.py", "models.py"):
            (empty / name).write_text("raise SystemExit('the user\\'s own')\n")
        (empty / "walk.py").write_text(SCRIPT)
        environment = {**os.environ, "PYTHONPATH": str(site)}
        for words in (["-P", "-m", "cmpc", "run", "undisturbed", "--steps", "2", "--log", "a.mcap"], ["walk.py"]):
            done = subprocess.run(
                [sys.executable, *words], cwd=empty, env=environment, capture_output=True, text=True, check=False
            )
            assert done.returncode == 0 and "completed" in done.stdout, done.stdout + done.stderr
        assert done.stdout.split()[1:] == [str(site / "cmpc.py"), str(site / "sim" / "__init__.py")], done.stdout
        made = sorted(path.name for path in empty.iterdir() if path.suffix == ".mcap")
        assert made == ["a.mcap", "run.mcap"], made
    print(f"{wheel.name}: {len(names)} files, walks alone")


if __name__ == "__main__":
    main()
