"""A run while it goes on: one process walks, another makes a page of its growing log that renews itself in the browser.

With `foxglove` or `rerun` as an argument the run is served to that viewer instead; extra `live`.
"""

import subprocess
import sys
import time
from pathlib import Path

CMPC = [sys.executable, "-m", "sim"]
run = [*CMPC, "run", "push-25N", "--steps", "6", "--quiet", "--log", "live.mcap"]

if sys.argv[1:] in (["foxglove"], ["rerun"]):
    raise SystemExit(subprocess.run([*run, "--live", sys.argv[1]], check=False).returncode)

walking = subprocess.Popen(run, stdout=subprocess.DEVNULL)
while not Path("live.mcap").exists() and walking.poll() is None:
    time.sleep(0.05)
page = ["review", "live.mcap", "--follow", "--out", "live.html", "--no-open"]
told = subprocess.run([*CMPC, *page], check=True, capture_output=True, text=True)
assert walking.wait() == 0
print(f"{told.stdout.strip()}\nlive.html showed the run as it grew; it is whole now")
