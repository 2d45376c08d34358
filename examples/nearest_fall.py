"""The nearest fall of ZD+PD: how little has to be wrong at once, and how probable that is; docs/reliability.md."""

import subprocess
import sys
from pathlib import Path

Path("nearest.toml").write_text(
    """
controllers = ["zd-pd"]

[scenario]
steps = 4

[[reliability]]
name = "push and load"
draws = 20
rays = 10
look = 10
most = 60

[[reliability.axes]]
name = "push in step 2"
paths = ["pushes.0.force"]
also = ["pushes.0.step = 2"]
distribution = "normal"
centre = 0.0
spread = 8.0

[[reliability.axes]]
name = "mass of torso"
paths = ["plant.mass_factor.torso"]
distribution = "log-normal"
centre = 1.0
spread = 0.15
""",
    encoding="utf-8",
)
cmpc = [sys.executable, "-m", "sim"]
subprocess.run([*cmpc, "trials", "nearest.toml", "--out", "nearest", "--quiet"], check=True)
