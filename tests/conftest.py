"""Shared belief, plainly written oracle and random states; everything seeded."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import oracle
import pytest
from hypothesis import settings
from numpy.typing import NDArray

from controller.belief import Gains, Gait, Loop, WalkerModel, load_gait

ROOT = Path(__file__).resolve().parents[1]
RABBIT = ROOT / "models" / "rabbit"

settings.register_profile("repeatable", derandomize=True, deadline=None, database=None)
settings.load_profile("repeatable")


def pytest_sessionstart(session: pytest.Session) -> None:
    """Compile before the whole suite: its workers would each compile the same, one after the other."""
    config = session.config
    whole = config.args_source is pytest.Config.ArgsSource.TESTPATHS
    if whole and config.getoption("numprocesses", None) and not hasattr(config, "workerinput"):
        from sim.bridge.kernels import prepare_all

        prepare_all()


@pytest.fixture(scope="session")
def model() -> WalkerModel:
    return WalkerModel(RABBIT / "rabbit.urdf")


@pytest.fixture(scope="session")
def gait(model: WalkerModel) -> Gait:
    return load_gait(RABBIT / "gaits" / "paper.toml", model)


@pytest.fixture(scope="session")
def gains() -> Gains:
    """K_P in [1/s^2] and K_D in [1/s] of Sec. III.E."""
    return Gains(kp=np.array([60.0, 90.0, 90.0, 50.0]), kd=np.array([10.0, 20.0, 20.0, 10.0]))


@pytest.fixture(scope="session")
def loop(model: WalkerModel, gait: Gait, gains: Gains) -> Loop:
    """The closed loop under ZD+PD."""
    return Loop(model.lumped, gait.table, gains)


@pytest.fixture(scope="session")
def walker(model: WalkerModel) -> oracle.Walker:
    return oracle.Walker(model.pinocchio)


States = list[tuple[NDArray[np.float64], NDArray[np.float64]]]


@pytest.fixture(scope="session")
def random_states() -> Callable[..., States]:
    """States (q in [rad], dq in [rad/s]) anywhere at all."""

    def draw(n: int, seed: int = 0) -> States:
        rng = np.random.default_rng(seed)
        return [(rng.uniform(-np.pi, np.pi, 5), rng.uniform(-10, 10, 5)) for _ in range(n)]

    return draw


@pytest.fixture(scope="session")
def walking_states(gait: Gait, model: WalkerModel) -> Callable[..., States]:
    """States scattered around the gait, from just after to just before an impact."""

    def draw(n: int, seed: int = 0, spread: float = 0.1) -> States:
        rng = np.random.default_rng(seed)
        q0, dq0 = gait.post_impact(model)
        found = []
        for _ in range(n):
            s = rng.uniform()
            q = (1 - s) * q0 + s * gait.q_minus + spread * rng.normal(size=5)
            dq = (1 - s) * dq0 + s * gait.dq_minus + 5 * spread * rng.normal(size=5)
            found.append((q, dq))
        return found

    return draw


@pytest.fixture(autouse=True)
def no_sign_of_life(monkeypatch: pytest.MonkeyPatch) -> None:
    """On a slow machine a command would say that it goes on, where a test counts lines."""
    monkeypatch.setattr("sim.terminal.pulse.SILENCES", (3600.0,))
