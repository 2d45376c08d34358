"""The exactly periodic gait next to one that is printed to a few decimals."""

import numpy as np
from scipy.optimize import least_squares

from controller.belief import Gait, WalkerModel
from controller.common.errors import UserError
from controller.common.records import Vector
from controller.design.orbit import periodic_orbit
from controller.design.parameters import LOWEST, Parametrisation, with_rates

LAST_DIGIT = 0.005
"""Half a unit of two decimals: what each printed number is known to, in its own unit."""


def polish(model: WalkerModel, gait: Gait) -> Gait:
    """The hybrid-invariant, periodic gait that misses the printed numbers least.

    All 28 coefficients and the 10 numbers of the state before impact count alike. The rates say more about the last
    slope than the coefficients do.

    Args:
        model: The walker.
        gait: A nearly periodic gait.

    Raises:
        UserError: its polynomials are of too low a degree, or no gait of this walker is near it.
    """
    degree = gait.alpha.shape[1] - 1
    if degree < LOWEST:
        raise UserError(f"gait {gait.name!r}: degree = {degree}; must be {LOWEST} or more to be polished")
    space = Parametrisation(model=model, degree=degree, step_length=None)

    def miss(p: Vector) -> Vector:
        candidate = space.gait(p)
        orbit = periodic_orbit(model, candidate)
        apart = (
            (candidate.alpha - gait.alpha).ravel(),
            candidate.q_minus - gait.q_minus,
            orbit.dq[-1] - gait.dq_minus,
        )
        return np.concatenate(apart) / LAST_DIGIT

    try:
        found = least_squares(miss, space.vector(gait), method="lm", xtol=1e-12, ftol=1e-12, gtol=1e-12)
    except ValueError as error:  # no posture, or nothing finite to begin with
        raise UserError(f"gait {gait.name!r}: no gait of {model.path} is near it ({error})") from error
    polished = space.gait(found.x, f"{gait.name}-polished", f"{gait.source}; polished to an exactly periodic orbit")
    orbit = periodic_orbit(model, polished)
    if not orbit.exists:
        raise UserError(
            f"gait {gait.name!r}: the nearest of {model.path} has no periodic orbit: it stops or does not settle"
        )
    return with_rates(polished, orbit)
