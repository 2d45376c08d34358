"""A gait: Bezier outputs h_d over the internal clock theta, and the file it comes from."""

from dataclasses import dataclass
from math import comb
from pathlib import Path
from typing import Any

import numpy as np

from controller.belief.closed_loop import GaitTable
from controller.belief.kernels import N_Q, N_U
from controller.belief.model import WalkerModel
from controller.belief.polynomial import power_basis
from controller.common import toml
from controller.common.errors import UserError
from controller.common.products import inner
from controller.common.records import ACTUATED, Vector, swap_legs

LARGEST = 1e6
"""Of any number in a gait file: beyond it arithmetic on it means nothing."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Gait:
    """One periodic step: the h_d and the clock theta = c q of the outputs y = h_0(q) - h_d(theta).

    Implements: Eq. (5).

    Attributes:
        name: Name in messages and logs.
        source: Where the numbers come from.
        alpha: Bezier coefficients of h_d,i in [rad], (4, M + 1): rows stance hip, swing hip, stance knee, swing
            knee; first column the posture after, last column the posture before impact.
        clock: c of theta = c q, (5,).
        q_minus: Coordinates just before impact in [rad], (5,).
        dq_minus: Rates just before impact in [rad/s], (5,).
        table: The same outputs, compiled for the kernels.
    """

    name: str
    source: str
    alpha: Vector
    clock: Vector
    q_minus: Vector
    dq_minus: Vector
    table: GaitTable

    @classmethod
    def of(cls, *, name: str, source: str, alpha: Vector, clock: Vector, q_minus: Vector, dq_minus: Vector) -> "Gait":
        """Build a gait; the clock's range follows from the posture before impact and its mirror image."""
        theta_plus, theta_minus = inner(clock, swap_legs(q_minus)), inner(clock, q_minus)
        table = GaitTable(
            poly=power_basis(alpha),
            clock=np.array(clock, dtype=float),
            theta_start=theta_plus,
            theta_span=theta_minus - theta_plus,
        )
        return cls(
            name=name,
            source=source,
            alpha=alpha,
            clock=clock,
            q_minus=q_minus,
            dq_minus=dq_minus,
            table=table,
        )

    @property
    def theta_plus(self) -> float:
        """Clock just after impact in [rad]."""
        return self.table.theta_start

    @property
    def theta_minus(self) -> float:
        """Clock just before impact in [rad]."""
        return self.table.theta_start + self.table.theta_span

    def normalised(self, theta: float) -> float:
        """S = (theta - theta+) / (theta- - theta+)."""
        return (theta - self.table.theta_start) / self.table.theta_span

    def desired(self, theta: float) -> tuple[Vector, Vector, Vector]:
        """h_d, dh_d/dtheta and d2h_d/dtheta2 at a clock value in [rad], (4,) each."""
        s, span = self.normalised(theta), self.table.theta_span
        return tuple(_bezier(self.alpha, s, order) / span**order for order in range(3))  # type: ignore[return-value]

    def post_impact(self, model: WalkerModel) -> tuple[Vector, Vector]:
        """First state of a step: the rigid impact of the state before it, Eq. (3)."""
        return model.impact(self.q_minus, self.dq_minus)


def _bezier(alpha: Vector, s: float, order: int) -> Vector:
    """Derivative of given order of the Bezier polynomials with respect to s, in Bernstein form."""
    degree = alpha.shape[1] - 1
    if order > degree:
        return np.zeros(alpha.shape[0])
    coefficients = alpha
    for k in range(order):
        coefficients = (degree - k) * np.diff(coefficients, axis=1)
    n = degree - order
    basis = np.array([comb(n, k) * s**k * (1.0 - s) ** (n - k) for k in range(n + 1)])
    return coefficients @ basis


def load_gait(path: Path, model: WalkerModel) -> Gait:
    """Read and check a gait file.

    Args:
        path: TOML file with name, source, clock, q_minus, dq_minus, alpha and the tolerances of its periodicity.
        model: The walker it is for; its impact map judges periodicity.

    Raises:
        UserError: file missing, unreadable, of wrong shape, not finite, for a walker of other links, or not periodic
            within its tolerance.
    """
    if not path.is_file():
        raise UserError(f"{path}: no such gait file")
    try:
        data = toml.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise UserError(f"{path}: cannot be read: {error.strerror}") from error
    except ValueError as error:  # UnicodeDecodeError is one
        raise UserError(f"{path}: not a TOML file ({error})") from error
    return parse_gait(data, str(path), model)


def parse_gait(data: dict[str, Any], where: str, model: WalkerModel) -> Gait:
    """Build and check a gait from the content of a gait file; `where` names it in errors."""
    made_for = data.get("fingerprint", model.fingerprint)
    if made_for != model.fingerprint:
        raise UserError(
            f"{where}: made for the walker {data.get('walker', '?')!r} with fingerprint {made_for!r}, but {model.path} "
            f"has {model.fingerprint!r}; must be designed for this walker, see cmpc gait design"
        )
    alpha = _array(data, "alpha", where, rows=N_U)
    gait = Gait.of(
        name=str(data.get("name", Path(where).stem)),
        source=str(data.get("source", "")),
        alpha=alpha,
        clock=_array(data, "clock", where, size=N_Q),
        q_minus=_array(data, "q_minus", where, size=N_Q),
        dq_minus=_array(data, "dq_minus", where, size=N_Q),
    )
    if gait.clock[-1] == 0.0:
        raise UserError(f"{where}: clock[4] = 0.0; must not be 0, the clock must feel the torso angle")
    degree = data.get("degree", alpha.shape[1] - 1)
    if degree != alpha.shape[1] - 1:
        raise UserError(
            f"{where}: degree = {degree!r:.40} but alpha has {alpha.shape[1]} columns; must be degree + 1 columns"
        )
    _check_periodic(gait, data, where, model)
    return gait


def _check_periodic(gait: Gait, data: dict[str, Any], where: str, model: WalkerModel) -> None:
    """Hybrid invariance: the posture and the rates after impact lie on the polynomials' start."""
    tolerance_q = _tolerance(data, "periodicity_tolerance_rad", 1e-3, where)
    tolerance_dq = _tolerance(data, "periodicity_tolerance_rad_s", 1e-2, where)
    if not gait.table.theta_span > 0.0:
        raise UserError(
            f"{where}: clock runs from {gait.theta_plus:.4f} to {gait.theta_minus:.4f} rad; it must grow in a step"
        )
    q_plus, dq_plus = gait.post_impact(model)
    start, slope, _ = gait.desired(gait.theta_plus)
    end = gait.desired(gait.theta_minus)[0]
    errors = {
        "posture before impact": (gait.q_minus[ACTUATED] - end, tolerance_q, "rad"),
        "posture after impact": (q_plus[ACTUATED] - start, tolerance_q, "rad"),
        "rates after impact": (dq_plus[ACTUATED] - slope * (gait.clock @ dq_plus), tolerance_dq, "rad/s"),
    }
    for what, (error, tolerance, unit) in errors.items():
        worst = float(np.abs(error).max())
        if not worst <= tolerance:
            raise UserError(
                f"{where}: not periodic, {what} misses the gait by {worst:.3g} {unit}; must be up to {tolerance} {unit}"
            )


def _tolerance(data: dict[str, Any], key: str, default: float, where: str) -> float:
    value = data.get(key, default)
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 < value <= LARGEST:
        raise UserError(f"{where}: {key} = {value!r:.40}; must be a number above 0, up to {LARGEST:g}")
    return float(value)


def _array(data: dict[str, Any], key: str, where: str, *, size: int | None = None, rows: int | None = None) -> Vector:
    """A finite array of (size,) or (rows, at least 3) from a gait file."""
    legal = f"{size} numbers" if size else f"{rows} rows of equal length, at least 3 coefficients each"
    if key not in data:
        raise UserError(f"{where}: {key} is missing; must be {legal}")
    try:
        array = np.array(data[key], dtype=float)
    except (TypeError, ValueError, OverflowError) as error:
        raise UserError(f"{where}: {key} is not an array of numbers; must be {legal}") from error
    fits = array.shape == (size,) if size else array.ndim == 2 and array.shape[0] == rows and array.shape[1] >= 3
    if not fits:
        raise UserError(f"{where}: {key} has shape {array.shape}; must be {legal}")
    if not np.isfinite(array).all():
        raise UserError(f"{where}: {key} holds a value that is not finite; must be {legal}")
    if np.abs(array).max() > LARGEST:
        raise UserError(f"{where}: {key} holds {np.abs(array).max():g}; must be {legal}, up to {LARGEST:g} each")
    return array
