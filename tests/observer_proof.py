"""How well the observer sees through wrong masses, bias, noise and loads: a table. `python -m tests.observer_proof`.

Every row is a walk of four steps of ZD+PD on the rigid plant, pushed by 20 N through the third, with one error: what is
seen before the push comes, what 60 ms after, and how soon 90 % of it.
"""

import numpy as np

from sim.bridge.run import run_scenario
from sim.loop import NoTape
from sim.scenario import Scenario, with_values

FORCE = 20.0  # [N]
LINKS = ("torso", "left_femur", "right_femur", "left_tibia", "right_tibia")
ERRORS = {
    "none": {},
    "torso 10 % heavier": {"plant.mass_factor.torso": 1.1},
    "torso 30 % heavier": {"plant.mass_factor.torso": 1.3},
    "all links 30 % heavier": {f"plant.mass_factor.{link}": 1.3 for link in LINKS},
    "tibias 30 % lighter": {f"plant.mass_factor.{leg}_tibia": 0.7 for leg in ("left", "right")},
    "bias of a hip, 0.01 rad": {"sensors.angle_bias.left_hip": 0.01},
    "angle noise, 0.001 rad": {"sensors.angle_noise": 0.001},
    "rate noise, 0.01 rad/s": {"sensors.rate_noise": 0.01},
    "rate noise, 0.05 rad/s": {"sensors.rate_noise": 0.05},
    "rate noise, 0.05 rad/s, lag 0.15 s": {"sensors.rate_noise": 0.05, "controller.observer.lag": 0.15},
    "6 kg, load_doubt 3": {"plant.mass_factor.torso": 1.5, "controller.observer.load_doubt": 3.0},
}


class Seen(NoTape):
    """Keeps the push that acts and the one that is seen, every tick."""

    def __init__(self) -> None:
        """Start empty."""
        self.push: list[float] = []
        self.seen: list[float] = []

    def ticks(self, ticks) -> None:
        """Keep them."""
        self.push += ticks.state["push"][:, 0].tolist()
        here = range(ticks.first, ticks.first + len(ticks))
        self.seen += [ticks.diagnostics[k]["observed push [N]"] for k in here]


def main() -> None:
    """Print the table."""
    walk = {"controller.kind": "zd-pd", "controller.observer.enabled": True, "plant.kind": "rigid"}
    print("| error | seen before it came, RMS [N] | seen after 60 ms [N] | 90 % after [ms] | steps |")
    print("|---|---|---|---|---|")
    for name, changes in ERRORS.items():
        tape = Seen()
        push = {"pushes": [{"force": FORCE, "step": 3}]}
        scenario = with_values(Scenario(gait="paper-polished", steps=4), walk | push | changes)
        summary = run_scenario(scenario, tape=tape)
        seen, push_on = np.array(tape.seen), np.flatnonzero(np.array(tape.push) != 0.0)
        if not len(push_on):
            print(f"| {name} | - | - | - | {summary.steps}: {summary.fall_reason} |")
            continue
        began = int(push_on[0])
        risen = np.flatnonzero(seen[began : push_on[-1]] > 0.9 * FORCE)
        off, after = np.sqrt(np.mean(seen[50:began] ** 2)), seen[min(began + 60, len(seen) - 1)]
        print(f"| {name} | {off:.1f} | {after:.1f} | {risen[0] if len(risen) else '-'} | {summary.steps} |")


if __name__ == "__main__":
    main()
