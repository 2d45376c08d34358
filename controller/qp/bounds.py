"""Torques at their bounds: the codes of an active-set guess, and the rule that corrects it."""

from controller.common.compiled import inlined

FREE, AT_LOWER, AT_UPPER = 0, -1, 1
TORQUE_TOLERANCE = 1e-9  # [N.m] beyond a bound
GRADIENT_TOLERANCE = 1e-6  # [cost/(N.m)] of the wrong sign at a bound


@inlined
def corrected(guess: int, u: float, lower: float, upper: float, gradient: float) -> int:
    """What a torque's guess should have been, seen from the answer under it.

    Args:
        guess: FREE, AT_LOWER or AT_UPPER.
        u: Torque found in [N.m].
        lower: Its lower bound in [N.m].
        upper: Its upper bound in [N.m].
        gradient: Of the objective by it.
    """
    if guess == FREE:
        if u < lower - TORQUE_TOLERANCE:
            return AT_LOWER
        return AT_UPPER if u > upper + TORQUE_TOLERANCE else FREE
    return FREE if guess * gradient > GRADIENT_TOLERANCE else guess
