"""A controller of one's own: two methods, run in the paper's first push, and why it ended as it did."""

import numpy as np

import sim
from controller import StanceEstimator


class Gait:
    """Hold every joint to the gait by a spring and a damper."""

    def __init__(self, model, gait):
        """Parameters are given by their names; docs/own-controller.md lists what there is to ask for."""
        self.gait, self.stance = gait, StanceEstimator(model)

    def reset(self, stance):
        """The run begins on this foot, "left" or "right"."""
        self.stance.reset(stance)

    def step(self, observation):
        """Torques of left hip, right hip, left knee, right knee in [N.m] for the next millisecond."""
        state = self.stance.update(observation)
        h, slope, _ = self.gait.desired(self.gait.clock @ state.q)
        y, dy = state.q[:4] - h, state.dq[:4] - slope * (self.gait.clock @ state.dq)
        return state.leg.from_body(np.clip(-300.0 * y - 20.0 * dy, -75.0, 75.0))


for name in ("undisturbed", "push-40N-first"):
    summary = sim.run(name, controller=Gait, log=f"own-{name}.mcap")
    print(f"{name}: {summary.outcome} after {summary.steps} steps {summary.fall_reason}")
    sim.write_review(summary.log, f"own-{name}.html")
