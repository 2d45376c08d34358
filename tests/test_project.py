"""The files around the code: pinned versions cover what is required, on every machine."""

import re
import tomllib

from conftest import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
PINS = (ROOT / "constraints.txt").read_text().splitlines()


def name(requirement):
    return re.match(r"[A-Za-z0-9._-]+", requirement)[0].lower().replace("_", "-")


def test_constraints_are_exact_versions_and_nothing_else():
    for line in PINS:
        assert re.fullmatch(r"[A-Za-z0-9._-]+==[0-9][0-9A-Za-z.]*", line), line
    assert len({name(line) for line in PINS}) == len(PINS)


def test_everything_required_is_pinned():
    extras = PROJECT["optional-dependencies"]
    required = {name(r) for r in PROJECT["dependencies"] + [r for group in extras.values() for r in group]}
    assert required - {PROJECT["name"]} <= {name(line) for line in PINS}
