"""How output errors change from one step to the next: the eigenvalues beside delta^2, without integrating anything.

Between impacts ddy = -K_D dy - K_P y exactly, whatever the walker does (Eqs. (8), (9)); an impact maps errors by
`orbit_kernels.impact_of_errors`. To first order a step multiplies (y, dy) by exp(A T) J, with T the step time. On a
hybrid invariant gait the Poincare map is block triangular, so these eigenvalues and delta^2 are all it has.
"""

import numpy as np

from controller.belief import Gains, Gait, WalkerModel
from controller.design import orbit_kernels
from controller.design.orbit import Orbit

LONGEST = 5.0  # [s] a step; no walk has one, an optimiser's trial may
UNBOUNDED = 1e3  # stands for the eigenvalues of a trial so wild that they are not finite


def transverse_eigenvalues(model: WalkerModel, gait: Gait, orbit: Orbit, gains: Gains) -> np.ndarray:
    """Eigenvalues of the output errors over a step, (8,), complex.

    Args:
        model: The walker.
        gait: A hybrid invariant gait.
        orbit: Its periodic orbit.
        gains: ZD+PD gains.
    """
    jump = orbit_kernels.impact_of_errors(model.lumped, gait.table, float(orbit.dtheta[-1]))
    product = orbit_kernels.decay(gains, float(np.clip(orbit.step_time, 0.0, LONGEST))) @ jump
    return np.linalg.eigvals(product) if np.isfinite(product).all() else np.full(8, UNBOUNDED, dtype=complex)
