"""One trial out of a folder of results, by its id CONTROLLER/NUMBER."""

import difflib
from pathlib import Path

from sim.errors import UserError
from sim.scenario import Scenario
from sim.trials.plan import CertificateStudy, Plan, ReliabilityStudy
from sim.trials.run.campaign import Results
from sim.trials.run.folder import FILE
from sim.trials.run.result import TrialResult
from sim.trials.run.store import Store
from sim.trials.run.trial import Point, trial_scenario


def split_id(text: str, plan: Plan) -> tuple[str, int]:
    """Controller and number of a trial's id.

    Raises:
        UserError: it is no id of the plan.
    """
    controller, _, number = text.rpartition("/")
    if not number.isdecimal():
        raise UserError(f"trial id {text!r}: must be CONTROLLER/NUMBER, such as {plan.controllers[0]}/0")
    if controller not in plan.controllers:
        near = difflib.get_close_matches(controller, plan.controllers, n=1)
        guess = f"; did you mean {near[0]}/{number}?" if near else f"; must be of {', '.join(plan.controllers)}"
        raise UserError(f"trial id {text!r}: the plan has no controller {controller!r}{guess}")
    plan.study_of(int(number))
    return controller, int(number)


def stored_trial(folder: str | Path, trial: str) -> TrialResult:
    """The result of a trial.

    Raises:
        UserError: no results there, no such id, or it has not been run.
    """
    with open_results(folder) as results:
        controller, number = split_id(trial, results.plan)
        result = results.store.result(controller, number)
        if result is None:
            raise UserError(f"trial {trial}: has not been run in {folder}")
        return result


def stored_scenario(reference: str) -> Scenario:
    """The scenario of a trial by DIR#ID, whether or not it has been run.

    Raises:
        UserError: no results there, or no such id.
    """
    folder, hash_sign, trial = reference.rpartition("#")
    if not hash_sign:
        raise UserError(f"--from-trial {reference}: must be DIR#CONTROLLER/NUMBER, such as results#c-mpc/17")
    with open_results(folder) as results:
        plan = results.plan
        controller, number = split_id(trial, plan)
        row = None
        if isinstance(plan.study_of(number)[0], ReliabilityStudy | CertificateStudy):
            row = results.store.result(controller, number)
            if row is None:
                raise UserError(f"trial {trial}: has not been run in {folder}, and its study asks as it learns")
    return trial_scenario(plan, controller, number) if row is None else scenario_of(plan, row)


def scenario_of(plan: Plan, row: TrialResult) -> Scenario:
    """The scenario of a trial that has been run, whatever its study.

    Raises:
        UserError: the plan has no such trial.
    """
    asked = isinstance(plan.study_of(row.trial)[0], ReliabilityStudy | CertificateStudy)
    point = Point(values=tuple(row.axis_values.values()), seed=row.seed) if asked else None
    return trial_scenario(plan, row.controller, row.trial, point)


def open_results(folder: str | Path) -> Results:
    """The results of a folder, with their plan; to be closed.

    Raises:
        UserError: there are none, or they cannot be read.
    """
    if not str(folder):
        raise UserError("folder of results: its name is empty; must be a folder that cmpc trials --out made")
    store = Store(Path(folder) / FILE)
    plan = store.plan()
    if plan is None:
        store.close()
        raise UserError(f"{folder}: holds no plan yet; its campaign stopped before its first trial")
    return Results(plan=plan, store=store)


def stored_plan(folder: str | Path) -> Plan:
    """The plan of a folder of results.

    Raises:
        UserError: there is none, or it cannot be read.
    """
    with open_results(folder) as results:
        return results.plan
