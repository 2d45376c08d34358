"""A fall explained: what broke, from when on, and what the signals were just then."""

import numpy as np

import sim

summary = sim.run(sim.with_value(sim.load("push-40N-first"), "steps", 4), controller="zd-pd", log="fall.mcap")
log = sim.read(summary.log)
print(f"it {log.answer}")
state, began = log["/plant/state"], log.onset
assert began is not None
for seconds in (-0.1, 0.0, 0.1, 0.2):
    row = int(np.searchsorted(state.t, began + seconds))
    torque = " ".join(f"{state[f'torque.{joint}'][row]:6.1f}" for joint in summary.peak_torque_Nm)
    print(f"{seconds:+.1f} s: torso {state['q.torso'][row]:+.2f} rad, torques {torque} N.m")
for event in log.events:
    if event.name in ("push", "impact", "fell"):
        print(f"{event.t:.3f} s {event.name}: {event.message}")
sim.write_review("fall.mcap", "fall.html")
