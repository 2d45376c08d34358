"""What if? A run from its log alone: as it was to the last bit, under another controller, on another floor."""

import sim

fell = sim.run(sim.with_value(sim.load("push-40N-first"), "steps", 4), controller="zd-pd", log="fell.mcap")
print(f"as it was: {fell.outcome} after {fell.steps} steps")
print("again, to the last bit:", sim.replay("fell.mcap").identical)
for words, changes, controller in (
    ("under C-MPC", {}, "c-mpc"),
    ("with half the push", {"pushes.0.force": 20.0}, None),
    ("on a slippery floor", {"pushes.0.force": 20.0, "plant.ground.friction": 0.3}, None),
):
    other = sim.replay("fell.mcap", changes, controller=controller)
    print(f"{words}: {other.outcome} after {other.steps} steps {other.fall_reason}")
