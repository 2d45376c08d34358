"""A sample of `make fuzz`: files with small mistakes end in one line of ours, or work."""

import fuzz
import pytest


@pytest.mark.parametrize("kind", fuzz.KINDS)
def test_a_sample_of_mutations_is_legal(kind):
    wrong, _, last = fuzz.alone(kind, 5000)
    assert not wrong, f"{wrong}: {last}"
