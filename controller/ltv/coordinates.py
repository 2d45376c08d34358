"""Output coordinates z = (y, dy, theta, dtheta) of the walker, and the link angles in terms of them.

With J = H [I; -c_a/c_5] the link angles are phi = J (y + h(theta)) + theta/c_5, and j = dphi/dtheta = J h' + 1/c_5.
"""

from controller.belief import kernels
from controller.belief.closed_loop import GaitTable, outputs
from controller.common.compiled import Array, nested

N_Z = 10
Y, DY, THETA, DTHETA = 0, 4, 8, 9  # first index of each part of z


@nested
def to_output(gait: GaitTable, q: Array, dq: Array, stage: kernels.Stage, z: Array) -> None:
    """Output coordinates of a state (q, dq)."""
    theta, dtheta = outputs(gait, q, dq, stage)
    for i in range(4):
        z[Y + i] = stage.y[i]
        z[DY + i] = stage.dy[i]
    z[THETA] = theta
    z[DTHETA] = dtheta


@nested
def from_output(gait: GaitTable, z: Array, q: Array, dq: Array) -> None:
    """State (q, dq) of output coordinates."""
    theta, dtheta = z[THETA], z[DTHETA]
    s_unclamped = (theta - gait.theta_start) / gait.theta_span
    s = min(max(s_unclamped, gait.s_first), gait.s_last)
    degree = gait.poly.shape[1] - 1
    q[4] = theta
    dq[4] = dtheta
    for i in range(4):
        h = gait.poly[i, degree]
        h1 = 0.0
        for k in range(degree - 1, -1, -1):
            h1 = h1 * s + h
            h = h * s + gait.poly[i, k]
        q[i] = z[Y + i] + h + h1 * (s_unclamped - s)
        dq[i] = z[DY + i] + h1 / gait.theta_span * dtheta
        q[4] -= gait.clock[i] * q[i]
        dq[4] -= gait.clock[i] * dq[i]
    q[4] /= gait.clock[4]
    dq[4] /= gait.clock[4]


@nested
def link_jacobian(gait: GaitTable, stage: kernels.Stage, J: Array, j: Array) -> None:
    """J = dphi/dy (5, 4), and j = dphi/dtheta (5,), after `outputs`."""
    inverse = 1.0 / gait.clock[4]
    for i in range(5):
        j[i] = inverse
        for k in range(4):
            J[i, k] = -gait.clock[k] * inverse
    J[0, 0] += 1.0
    J[2, 0] += 1.0
    J[1, 1] += 1.0
    J[3, 1] += 1.0
    J[2, 2] += 1.0
    J[3, 3] += 1.0
    for i in range(5):
        for k in range(4):
            j[i] += J[i, k] * stage.h1[k]


@nested
def times_J(gait: GaitTable, row: Array, out: Array) -> None:
    """Row (5,) times J = dphi/dy, (4,): what the joints turn, and the torso that makes up for it in the clock."""
    torso = -(row[0] + row[1] + row[2] + row[3] + row[4]) / gait.clock[4]
    out[0] = row[0] + row[2] + torso * gait.clock[0]
    out[1] = row[1] + row[3] + torso * gait.clock[1]
    out[2] = row[2] + torso * gait.clock[2]
    out[3] = row[3] + torso * gait.clock[3]
