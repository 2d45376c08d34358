"""Products that no BLAS has a say in: right to rounding, fused, and used wherever a run's bits come from."""

import subprocess
import sys
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from controller.common import polynomials
from controller.common.products import applied, inner, product

ROOT = Path(__file__).resolve().parent.parent
PROBE = """
import hashlib
from sim.bridge.run import run_scenario
from sim.loop.tape import EachTick
from sim.scenario import load, with_values

class Hash(EachTick):
    def __init__(self):
        self.hash = hashlib.sha256()
    def tick(self, k, state, observation, step, tick_s):
        for part in (state.q, state.dq, state.torque, state.contact_force, step.u_total, step.contact_force):
            self.hash.update(part.tobytes())

runs = [(plant, kind) for plant in ("mujoco", "rigid") for kind in ("zd-pd", "c-mpc")]
runs += [("mujoco", "c-mpc-ltv"), ("mujoco", "c-mpc-plan")]  # the rivals factor by LAPACK when they are built
for plant, kind in runs:
    ticks = Hash()
    changes = {"controller.kind": kind, "plant.kind": plant, "time_limit": 0.45}
    run_scenario(with_values(load("push-40N-first"), changes), tape=ticks)
    print(plant, kind, ticks.hash.hexdigest())
"""


def fused(a, b, c):
    return float(Fraction(float(a)) * Fraction(float(b)) + Fraction(c))


def test_a_product_is_a_chain_of_fused_multiply_adds():
    rng = np.random.default_rng(1)
    a, b = rng.normal(size=(4, 7)), rng.normal(size=(7, 3))
    for i in range(4):
        for j in range(3):
            total = 0.0
            for k in range(7):
                total = fused(a[i, k], b[k, j], total)
            assert product(a, b)[i, j] == total
    assert inner(a[0], b[:, 0].copy()) == product(a, b)[0, 0]


@pytest.mark.parametrize("k", [4, 5, 6, 7])
def test_products_are_right(k):
    rng = np.random.default_rng(k)
    a, x = rng.normal(size=(7, k)), rng.normal(size=k)
    np.testing.assert_allclose(applied(a, x), a @ x, rtol=1e-13, atol=1e-14)
    np.testing.assert_allclose(product(a.T, a), a.T @ a, rtol=1e-13, atol=1e-13)


def test_a_polynomial_is_the_nearest():
    rng = np.random.default_rng(3)
    x, y = np.sort(rng.uniform(0.0, 1.0, 400)), rng.normal(size=400)
    found, wanted = polynomials.fit(x, y, 8), np.polynomial.polynomial.polyfit(x, y, 8)
    assert abs(np.polynomial.polynomial.polyval(x, found - wanted)).max() < 1e-11 * abs(wanted).max()


def test_runs_do_not_depend_on_the_kernel_that_a_blas_picks():
    def run(kernel):
        environment = {"PATH": "", "OPENBLAS_CORETYPE": kernel, "HOME": str(Path.home())}
        done = subprocess.run(
            [sys.executable, "-c", PROBE], cwd=ROOT, env=environment, capture_output=True, text=True, check=True
        )
        return done.stdout

    haswell, prescott = run("Haswell"), run("Prescott")
    assert haswell.count("\n") == 6 and haswell == prescott
