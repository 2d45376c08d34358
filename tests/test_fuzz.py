"""A sample of `make fuzz`: files with small mistakes end in one line of ours, or work."""

import fuzz
import pytest


def test_what_mujoco_warns_of_is_no_line():
    wrong, code, last = fuzz.alone("plant", 438)  # a joint with next to no inertia below it
    assert not wrong and code == "2" and "degrees of freedom" in last


@pytest.mark.parametrize("kind", fuzz.KINDS)
def test_a_sample_of_mutations_is_legal(kind):
    wrong, _, last = fuzz.alone(kind, 5000)
    assert not wrong, f"{wrong}: {last}"
