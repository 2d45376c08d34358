"""RABBIT with random masses, inertias and lengths; run as a program, it designs a gait for twenty of them."""

import re
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from conftest import RABBIT

from controller.belief import WalkerModel
from controller.common.errors import UserError
from controller.design.optimise import design
from controller.design.requirements import Requirements

SPREAD = 0.3


def random_urdf(seed: int) -> str:
    """RABBIT's URDF, each kind of link with its own factors on mass, inertia and length (centre of mass along)."""
    rng = np.random.default_rng(seed)
    text = (RABBIT / "rabbit.urdf").read_text()
    factors = {kind: rng.uniform(1 - SPREAD, 1 + SPREAD, 3) for kind in ("torso", "femur", "tibia")}

    def scaled(match: re.Match[str], factor: float) -> str:
        return f"{match[1]}{float(match[2]) * factor:.12g}{match[3]}"

    def link(match: re.Match[str]) -> str:
        mass, inertia, length = factors[match[1].split("_")[-1]]
        block = re.sub(r'(<mass value=")([\d.]+)(")', lambda m: scaled(m, mass), match[0])
        block = re.sub(r'(i[xyz]{2}=")([\d.]+)(")', lambda m: scaled(m, inertia), block)
        return re.sub(r'(<inertial>\s*<origin xyz="0 0 )([\d.]+)(")', lambda m: scaled(m, length), block)

    text = re.sub(r'<link name="(\w+)">.*?</link>', link, text, flags=re.S)
    for child, kind in (("tibia", "femur"), ("foot", "tibia")):  # the joint at a link's end carries its length
        pattern = rf'(<child link="\w+_{child}"/>\s*<origin xyz="0 0 )([\d.]+)(")'
        text = re.sub(pattern, lambda m, kind=kind: scaled(m, factors[kind][2]), text)
    return text


def scaled_urdf(scale: float) -> str:
    """RABBIT's URDF for a walker that is dynamically similar to it: lengths times the scale, time by its root."""
    powers = {
        r'(<origin xyz="0 [-\d.]+ )([\d.]+)(")': 1.0,
        r'(<mass value=")([\d.]+)(")': 3.0,
        r'(i[xyz]{2}=")([\d.]+)(")': 5.0,
        r'(effort=")([\d.]+)(")': 4.0,
        r'(damping=")([\d.]+)(")': 4.5,
    }
    text = (RABBIT / "rabbit.urdf").read_text()
    for pattern, power in powers.items():
        text = re.sub(pattern, lambda m, factor=scale**power: f"{m[1]}{float(m[2]) * factor:.12g}{m[3]}", text)
    return text


def random_model(seed: int, folder: Path) -> WalkerModel:
    path = folder / f"random-{seed}.urdf"
    path.write_text(random_urdf(seed))
    return WalkerModel(path)


def main(walkers: int = 20) -> None:
    found = 0
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(walkers):
            start = time.perf_counter()
            try:
                model = random_model(seed, Path(folder))
                gait = design(model, Requirements(step_length=0.4, speed=0.8))
                orbit = gait.orbit
                words = f"{model.lumped.mass:.1f} kg, legs {model.leg_length:.3f} m: cost {orbit.cost:.0f} N^2 m s"
                words += f", delta^2 {orbit.delta**2:.3f}"
                found += 1
            except UserError as error:
                words = str(error)
            print(f"{seed:2d} {time.perf_counter() - start:5.1f} s  {words}", flush=True)
    print(f"{found} of {walkers}")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
