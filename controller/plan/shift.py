"""A plan some time later: what is left of it, divided anew."""

from controller.common.compiled import Array, compiled
from controller.plan.dynamics import N_U, N_X
from controller.plan.motion import Motion


@compiled
def shift(plan: Motion, K: Array, passed: float, least: float, other: Motion, scratch: Array) -> None:
    """Move the plan on in place by some time of its first step.

    Args:
        plan: The motion planned.
        K: Feedback about it, (N, 4, nz).
        passed: Time in [s].
        least: Time that the first step keeps in [s].
        other: Scratch.
        scratch: Of the shape of K.
    """
    P = plan.T.shape[0]
    intervals = (plan.u.shape[0] + 1) // P - 1
    T = plan.T[0]
    left = max(T - passed, least)
    first = T - left
    other.x[:] = plan.x
    other.u[:] = plan.u
    scratch[:] = K
    h = T / intervals
    n = K.shape[2]
    for j in range(intervals):
        t = first + left * j / intervals
        i = min(int(t / h), intervals - 1)
        part = t / h - i
        a, b = part * part * (3.0 - 2.0 * part), h * part * (1.0 - part)
        for m in range(5):
            start, end = other.x[i, m], other.x[i + 1, m]
            fast, faster = other.x[i, 5 + m], other.x[i + 1, 5 + m]
            plan.x[j, m] = start + a * (end - start) + b * ((1.0 - part) * fast - part * faster)
            plan.x[j, 5 + m] = fast + part * (faster - fast)
        at = min(max((first + left * (j + 0.5) / intervals) / h - 0.5, 0.0), intervals - 1.0)
        i = min(int(at), intervals - 2)
        part = at - i
        for m in range(N_U):
            plan.u[j, m] = other.u[i, m] + part * (other.u[i + 1, m] - other.u[i, m])
            for c in range(n):
                K[j, m, c] = scratch[i, m, c] + part * (scratch[i + 1, m, c] - scratch[i, m, c])
    plan.T[0] = left


@compiled
def exchange(plan: Motion, K: Array, time: float) -> None:
    """The legs have been exchanged, in place: every step becomes the one before it, and the last stays for a new one.

    Args:
        plan: The motion planned.
        K: Feedback about it, (N, 4, nz).
        time: Of the new last step in [s].
    """
    P = plan.T.shape[0]
    intervals = (plan.u.shape[0] + 1) // P - 1
    n = K.shape[2]
    for p in range(P - 1):
        plan.T[p] = plan.T[p + 1]
        for j in range(intervals + 1):
            new, old = p * (intervals + 1) + j, (p + 1) * (intervals + 1) + j
            for m in range(N_X):
                plan.x[new, m] = plan.x[old, m]
            if j < intervals:
                for m in range(N_U):
                    plan.u[new, m] = plan.u[old, m]
                    for c in range(n):
                        K[new, m, c] = K[old, m, c] if c < N_X else 0.0
    plan.T[P - 1] = time
