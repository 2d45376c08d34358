"""The impact on the ground believed in, with its saltation matrix.

A predicted impact enters the linearisation by the Jacobian of the impact map with the shift of the impact's time
(Aizerman and Gantmakher 1958; Leine and Nijmeijer 2004, ch. 7).
"""

import numpy as np

from controller.belief import kernels
from controller.belief.closed_loop import GaitTable, Loop, clock_of, closed_loop, outputs
from controller.belief.ground import Ground, clearance
from controller.belief.kernels import Walker
from controller.belief.linalg import cholesky5_solve
from controller.common.compiled import Array, nested
from controller.ltv.coordinates import DTHETA, DY, N_Z, THETA, Y, from_output, link_jacobian, to_output
from controller.ltv.motion import COLUMNS, accelerate


@nested
def clearance_gradient(walker: Walker, gait: GaitTable, ground: Ground, stage: kernels.Stage, by_z: Array) -> None:
    """Derivative of the height above the ground by z, (10,)."""
    link, by_q = np.empty(5), np.empty(5)
    inverse = 1.0 / gait.clock[4]
    for i in range(5):
        link[i] = -walker.reach[i] * (stage.sin[i] - ground.tangent * stage.cos[i])
    by_q[0] = link[0] + link[2]
    by_q[1] = link[1] + link[3]
    by_q[2] = link[2]
    by_q[3] = link[3]
    by_q[4] = link[0] + link[1] + link[2] + link[3] + link[4]
    by_z[:] = 0.0
    by_z[THETA] = by_q[4] * inverse
    for k in range(4):
        by_z[Y + k] = by_q[k] - by_q[4] * gait.clock[k] * inverse
        by_z[THETA] += by_z[Y + k] * stage.h1[k]


@nested
def impact_jacobian(
    walker: Walker, gait: GaitTable, q: Array, dq: Array, stage: kernels.Stage, jacobian: Array
) -> None:
    """Impact in place, after `place` and `outputs`, and dz+/dz- of the impact map into jacobian (10, 10)."""
    J = np.empty((5, 4))
    j = np.empty(5)
    link_jacobian(gait, stage, J, j)
    dtheta = clock_of(gait, dq)
    phi_z = np.zeros((5, N_Z))
    dphi_z = np.zeros((5, N_Z))
    for i in range(5):
        rate = 0.0
        for k in range(4):
            phi_z[i, Y + k] = J[i, k]
            dphi_z[i, DY + k] = J[i, k]
            rate += J[i, k] * stage.h2[k] * dtheta
        phi_z[i, THETA] = j[i]
        dphi_z[i, THETA] = rate
        dphi_z[i, DTHETA] = j[i]
    # Momentum about the new foot, m_i = sum_j A_impact_ij cos_ij dphi_j, in the new names.
    momentum_z = np.zeros((5, N_Z))
    new_phi_z = np.zeros((5, N_Z))
    for i in range(5):
        row = kernels.MIRROR[i]
        own = 0.0
        for k in range(5):
            a = walker.A_impact[i, k]
            cosine = a * (stage.cos[i] * stage.cos[k] + stage.sin[i] * stage.sin[k])
            sine = a * (stage.sin[i] * stage.cos[k] - stage.cos[i] * stage.sin[k])
            rotor = 0.0
            if walker.extended:
                across = walker.A_impact_across[i, k]
                cosine += across * (stage.sin[i] * stage.cos[k] - stage.cos[i] * stage.sin[k])
                sine -= across * (stage.cos[i] * stage.cos[k] + stage.sin[i] * stage.sin[k])
                rotor = walker.rotor[i, k]
            by_phi = sine * stage.dphi[k] if k != i else 0.0
            own -= by_phi
            for m in range(N_Z):
                momentum_z[row, m] += by_phi * phi_z[k, m] + (cosine + rotor) * dphi_z[k, m]
        for m in range(N_Z):
            momentum_z[row, m] += own * phi_z[i, m]
            new_phi_z[row, m] = phi_z[i, m]
    kernels.impact(walker, q, dq, stage)
    # D(phi+) dphi+ = m: differentiate, with the inertia at the new state.
    new_dphi_z = np.empty((N_Z, 5))
    for m in range(N_Z):
        x = new_dphi_z[m]
        for i in range(5):
            v = momentum_z[i, m]
            for k in range(5):
                if k != i:
                    sine = walker.A[i, k] * (stage.sin[i] * stage.cos[k] - stage.cos[i] * stage.sin[k])
                    if walker.extended:
                        sine -= walker.A_across[i, k] * (stage.cos[i] * stage.cos[k] + stage.sin[i] * stage.sin[k])
                    v -= sine * stage.dphi[k] * (new_phi_z[k, m] - new_phi_z[i, m])
            x[i] = v
        cholesky5_solve(stage.L, x)
    outputs(gait, q, dq, stage)
    dtheta = clock_of(gait, dq)
    dq_m = np.empty(5)
    ddq_m = np.empty(5)
    phi_m = np.empty(5)
    for m in range(N_Z):
        for i in range(5):
            phi_m[i] = new_phi_z[i, m]
        kernels.from_links(phi_m, dq_m)
        kernels.from_links(new_dphi_z[m], ddq_m)
        theta_m, dtheta_m = clock_of(gait, dq_m), clock_of(gait, ddq_m)
        for i in range(4):
            jacobian[Y + i, m] = dq_m[i] - stage.h1[i] * theta_m
            jacobian[DY + i, m] = ddq_m[i] - stage.h1[i] * dtheta_m - stage.h2[i] * dtheta * theta_m
        jacobian[THETA, m] = theta_m
        jacobian[DTHETA, m] = dtheta_m


@nested
def land(
    loop: Loop, ground: Ground, u_mpc: Array, z: Array, AB: Array, q: Array, dq: Array, stage: kernels.Stage,
    linearise: bool,
) -> None:  # fmt: skip
    """The impact at z, in place, and its saltation matrix into AB from the left."""
    walker, gait = loop.walker, loop.gait
    from_output(gait, z, q, dq)
    kernels.place(q, dq, stage)
    if not linearise:
        kernels.impact(walker, q, dq, stage)
        to_output(gait, q, dq, stage, z)
        return
    before, after, height_z = np.empty(N_Z), np.empty(N_Z), np.empty(N_Z)
    jacobian = np.empty((N_Z, N_Z))
    _, dtheta = closed_loop(loop, q, dq, stage)
    accelerate(loop, dtheta, u_mpc, stage, before)
    _, _, descent = clearance(walker, ground, stage)
    clearance_gradient(walker, gait, ground, stage, height_z)
    impact_jacobian(walker, gait, q, dq, stage, jacobian)
    to_output(gait, q, dq, stage, z)
    _, dtheta = closed_loop(loop, q, dq, stage)
    accelerate(loop, dtheta, u_mpc, stage, after)
    for i in range(N_Z):
        jump = after[i]
        for m in range(N_Z):
            jump -= jacobian[i, m] * before[m]
        after[i] = jump / descent
    for i in range(N_Z):
        for m in range(N_Z):
            jacobian[i, m] += after[i] * height_z[m]
    old = AB.copy()
    for i in range(N_Z):
        for m in range(COLUMNS):
            AB[i, m] = 0.0
        for k in range(N_Z):
            v = jacobian[i, k]
            for m in range(COLUMNS):
                AB[i, m] += v * old[k, m]
