"""The observer: its law of momentum, how soon it sees a push, what it takes for a load, and who may ask it."""

import numpy as np
import pytest

import sim
from controller.belief import kernels
from controller.observer.momentum import momentum
from controller.observer.observer import body_of
from sim.bridge.run import run_scenario
from sim.loop import NoTape
from sim.scenario import Scenario, with_values

CALM = Scenario(gait="paper-polished", steps=4)
OBSERVED = {"controller.kind": "zd-pd", "controller.observer.enabled": True, "plant.kind": "rigid"}


def test_no_torque_changes_the_momentum_about_the_stance_foot(model, random_states):
    body, stage, h = body_of(model), kernels.new_stage(), 1e-6
    rng = np.random.default_rng(1)
    for q, dq in random_states(50):
        ddq = model.acceleration(q, dq, rng.uniform(-100.0, 100.0, 4))
        sigma = []
        for t in (-h, h):
            kernels.place(q + t * dq, dq + t * ddq, stage)
            sigma.append(momentum(body, stage)[0])
        kernels.place(q, dq, stage)
        moment = momentum(body, stage)[1]
        assert (sigma[1] - sigma[0]) / (2 * h) == pytest.approx(moment, abs=1e-4 * np.abs(dq).max() ** 2)


class Figures(NoTape):
    def __init__(self):
        self.rows, self.push = [], []

    def ticks(self, ticks):
        self.rows += [ticks.diagnostics[k] for k in range(ticks.first, ticks.first + len(ticks))]
        self.push += ticks.state["push"][:, 0].tolist()


def figures(changes):
    tape = Figures()
    run_scenario(with_values(CALM, OBSERVED | changes), tape=tape)
    return {name: np.array([row[name] for row in tape.rows]) for name in tape.rows[0]}, np.array(tape.push)


@pytest.mark.parametrize("force", [20.0, -10.0])
def test_a_push_is_seen_within_60_ms_and_forgotten_as_soon(force):
    seen, push = figures({"pushes": [{"force": force, "step": 3}]})
    began, ended = np.flatnonzero(np.diff(push)) + 1
    share = seen["observed push [N]"] / force
    assert np.abs(share[:began]).max() < 0.05
    assert (share[began + 60 : ended] > 0.85).all() and share.max() < 1.2
    assert np.abs(share[ended + 100 : ended + 400]).max() < 0.2  # 12 ms of them an impact


def test_a_load_is_told_from_a_push():
    seen, _ = figures(
        {"plant.mass_factor.torso": 1.5, "controller.kind": "c-mpc", "controller.observer.load_doubt": 3.0}
    )
    assert seen["observed load [kg]"][-1] == pytest.approx(6.0, rel=0.15)
    last = slice(-400, None)
    assert np.abs(seen["observed push [N]"][last]).mean() < 2.0


def test_a_slope_is_the_line_between_the_footholds():
    seen, _ = figures({"plant.ground.slope": -0.03, "steps": 3})
    assert seen["observed slope"][-1] == pytest.approx(-0.03, abs=0.01)


OWN = """
class Own:
    def __init__(self, model, observer):
        self.observer = observer
    def reset(self, stance): pass
    def step(self, observation):
        assert self.observer.memory["t"][0] == observation.t
        return [0.0] * 4
make = Own
"""


def test_a_controller_from_outside_may_ask_for_it(tmp_path):
    (tmp_path / "own.py").write_text(OWN)
    log = tmp_path / "own.mcap"
    summary = sim.run("undisturbed", controller=str(tmp_path / "own.py"), log=log)
    assert summary.outcome == "fell"
    assert sim.read(log)["/diagnostics"].units["observed_push"] == "N"
    sim.write_review(log, tmp_path / "own.html")
    assert "diagnostics.observed_push" in (tmp_path / "own.html").read_text()
