"""A robot of one's own: from its URDF to a folder, a gait and a walk. The same by commands: docs/own-walker.md."""

import re
import subprocess
import sys
from pathlib import Path

import sim
from sim.walkers import WalkerFolder

text = WalkerFolder.find("rabbit").urdf.read_text(encoding="utf-8")  # yours instead
mass = re.search(r'<link name="torso">.*?<mass value="([\d.]+)"', text, re.S)
assert mass is not None
at = mass.span(1)
Path("heavy.urdf").write_text(f"{text[: at[0]]}{1.1 * float(mass[1]):g}{text[at[1] :]}", encoding="utf-8")

subprocess.run([sys.executable, "-m", "sim", "walker", "new", "heavy", "--urdf", "heavy.urdf"], check=True)
gait = sim.design("./heavy", step_length=0.4, speed=0.8, out="heavy/gaits/walk.toml")
scenario = sim.with_values(sim.load("undisturbed"), {"walker": "./heavy", "gait": "walk", "steps": 5})
summary = sim.run(scenario)
print(f"{gait}: {summary.outcome} after {summary.steps} steps, {summary.step_length_m:.3f} m each")
