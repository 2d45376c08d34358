"""A limit beside controllers: the push that anybody could hold, and what each holds of it; extra `design`."""

import sim

found = sim.limit("push-forward", starts=1, intervals=(10, 14))
limit = found.value
print(f"any controller, as far as was found: {limit:.0f} N through step 1; {found.sure}")
base = sim.with_values(sim.load("push-40N-first"), {"steps": 6, "plant.ground.friction": 0.8})
for kind in ("zd-pd", "c-mpc"):
    low, high = 0.0, limit
    while high - low > 5.0:
        force = 0.5 * (low + high)
        walked = sim.run(sim.with_value(base, "pushes.0.force", force), controller=kind).outcome == "completed"
        low, high = (force, high) if walked else (low, force)
    print(f"{kind}: {low:.0f} N walked, {high:.0f} N fell: {low / limit:.0%} of it")
