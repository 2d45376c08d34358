"""A sample of `make fuzz`: files with small mistakes end in one line of ours, or work."""

import subprocess
import sys

from conftest import ROOT


def test_a_sample_of_mutations_is_legal():
    argv = [sys.executable, "tests/fuzz.py", "--count", "40", "--seed", "5000", "--workers", "1"]
    done = subprocess.run(argv, capture_output=True, text=True, cwd=ROOT, check=False)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-1000:]
    assert "40 mutations, 0 wrong" in done.stdout
