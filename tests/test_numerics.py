"""The numerics study: variants change what they say, and claims differ where verdicts do."""

import json
from pathlib import Path

import mujoco
import pytest

from sim.errors import UserError
from sim.plant import MujocoPlant
from sim.scenario import Scenario, with_values
from sim.trials import numerics
from sim.trials.plan import GridStudy, Plan, load_plan
from sim.trials.plan.grid import GridAxis
from sim.trials.run import Results, TrialResult
from sim.trials.run.store import Store

RABBIT = Path(__file__).parents[1] / "models" / "rabbit" / "rabbit.xml"


def model(variant: str) -> mujoco.MjModel:
    scenario = with_values(Scenario(), numerics.VARIANTS[variant])
    return MujocoPlant(scenario.plant, RABBIT, 1e-3).model


def test_a_variant_changes_what_it_says_and_nothing_else() -> None:
    plain = model(numerics.AS_IT_IS)
    foot = plain.geom("left_foot").id
    assert model("pyramidal cone").opt.cone == mujoco.mjtCone.mjCONE_PYRAMIDAL != plain.opt.cone
    assert model("impratio 10").opt.impratio == 10.0
    assert model("solref 4 ms").geom_solref[foot].tolist() == [4e-3, 1.0]
    assert model("solimp from 0.95").geom_solimp[foot][:3].tolist() == [0.95, 0.95, 1e-3]
    assert model("solimp from 0.9").geom_solimp[foot][:2].tolist() == [0.9, 0.9]
    assert model("foot of 5 mm").geom_size[foot][0] == 5e-3
    assert model("step 0.05 ms").opt.timestep == 5e-5
    assert model("foot of 5 mm").body_mass.tolist() == plain.body_mass.tolist()


def test_there_are_enough_variants_and_every_one_is_a_legal_plan() -> None:
    plan = load_plan("headlines")
    assert len(numerics.VARIANTS) >= 12
    assert {study.name for study in plan.studies} >= {"undisturbed", "push-25N", "push-40N-first", "payload-x2"}
    for name in numerics.VARIANTS:
        assert numerics.variant(plan, name).scenario.plant == with_values(Scenario(), numerics.VARIANTS[name]).plant


def test_a_claim_names_the_variants_that_say_otherwise_and_figures_move_by_their_share(tmp_path) -> None:
    push = GridAxis(paths=("pushes.0.force",), also=("pushes.0.step = 2",), values=(1.0, 2.0))
    plan = Plan(name="p", controllers=("zd-pd",), grid=(GridStudy(name="push", axes=(push,)),))

    def run_one(plan: Plan, folder: Path) -> Results:
        store = Store(None, write=True)
        rigid = plan.scenario.plant.kind == "rigid"
        for trial in range(2):
            fell = rigid and trial == 1
            store.add(
                TrialResult(
                    controller="zd-pd",
                    trial=trial,
                    study="push",
                    values=json.dumps({"pushes.0.force": trial + 1.0}),
                    seed=1,
                    outcome="fell" if fell else "completed",
                    survived=not fell,
                    steps=3,
                    output_error_rms_rad=0.02 if rigid else 0.01,
                )
            )
        return Results(plan=plan, store=store)

    page = numerics.run(plan, tmp_path, ["rigid"], run_one)
    assert page is not None and "does: rigid: falls in step" in page.read_text(encoding="utf-8")
    data = json.loads((tmp_path / numerics.DATA).read_text())
    assert [claim["differs"] for claim in data["claims"]] == [[], ["rigid"]]
    assert data["claims"][0]["verdict"] == "does not depend on the simulator's numerics"
    (moved,) = [one for one in data["figures"] if one["figure"] == "output_error_rms_rad"]
    assert moved["most"] == {"rigid": pytest.approx(1.0)}


def test_variants_that_say_nothing_about_a_plan_are_left_out(tmp_path) -> None:
    push = GridAxis(paths=("pushes.0.force",), also=("pushes.0.step = 2",), values=(1.0,))
    step = GridAxis(paths=("plant.timestep",), values=(5e-4,))
    cone = GridAxis(
        paths=("pushes.0.force",), also=("pushes.0.step = 2", "plant.contact.cone = pyramidal"), values=(1.0,)
    )

    def plan(axis: GridAxis, **changes) -> Plan:
        scenario = with_values(Scenario(), changes)
        return Plan(name="p", controllers=("zd-pd",), scenario=scenario, grid=(GridStudy(name="g", axes=(axis,)),))

    assert [name for name in numerics.VARIANTS if numerics.unfit(plan(push), name)] == []
    assert "must divide" in numerics.unfit(plan(push, **{"controller.period": 2.5e-4}), "step 0.5 ms")
    assert "set plant.timestep" in numerics.unfit(plan(step), "step 0.1 ms")
    assert "set plant.contact.cone" in numerics.unfit(plan(cone), "pyramidal cone")
    rigid = plan(push, **{"plant.kind": "rigid"})
    left = [name for name in numerics.VARIANTS if not numerics.unfit(rigid, name)]
    assert left == ["as it is", "step 0.5 ms", "step 0.1 ms", "step 0.05 ms", "rigid, scuffs are falls"]
    with pytest.raises(UserError, match=r"no variant says anything about it \(RK4: the rigid plant"):
        numerics.run(rigid, tmp_path, ["RK4"], lambda *_: pytest.fail("nothing should run"))
