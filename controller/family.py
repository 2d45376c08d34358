"""A family of gaits around one, by speed: what the gait library says a change of speed means.

The walker follows a gait of its own, which need not be in the library. The member of the family at another speed is the
library's gait of that speed and the own gait's step length, plus a part of what sets the own gait apart from the
library: all of it at the own speed, so that the member there is the gait itself, none at the ends of the library. The
sum is taken in the free numbers of `design.parameters`, where all sums are hybrid invariant. Members are worked out on
a grid beforehand; between its points their coefficients are mixed, which takes microseconds.
"""

from dataclasses import dataclass

import numpy as np

from controller.design.orbit import periodic_orbit
from controller.design.parameters import CLOCK, NoPosture, Parametrisation, elevate, with_rates
from controller.errors import ControllerInputError
from controller.gait import Gait
from controller.library import GaitLibrary
from controller.records import Vector

SPEED_STEP = 0.025  # [m/s] between members at most; a mixture misses hybrid invariance by 1e-3 rad/s
DEGREE = 8  # of the clock's rate along a step, as polynomial


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GaitFamily:
    """Gaits at n speeds of a walker, all of one step length.

    Attributes:
        gait: The walker's own gait.
        speed: Its mean speed in [m/s].
        speeds: Of the members, as distances from it in [m/s], ascending, 0 among them, (n,).
        alpha: Their Bezier coefficients in [rad], (n, 4, M + 1).
        q_minus: Their postures before impact in [rad], (n, 5).
        dq_minus: Their rates before impact in [rad/s], (n, 5).
        rate: Their clock rates along a step less the own gait's in [rad/s], as polynomials of the normalised clock,
            lowest power first, (n, DEGREE + 1).
        momentum: Their angular momenta about the stance foot after an impact in [kg m^2/s], ascending, (n,).
    """

    gait: Gait
    speed: float
    speeds: Vector
    alpha: Vector
    q_minus: Vector
    dq_minus: Vector
    rate: Vector
    momentum: Vector

    @classmethod
    def around(cls, gait: Gait, library: GaitLibrary) -> "GaitFamily":
        """The family of a gait; takes about 0.1 s.

        Raises:
            ControllerInputError: the gait's clock is not the library's, its speed or step length are outside of the
                library, or the library's gaits can not be mixed with it.
        """
        if not np.array_equal(gait.clock, CLOCK):
            raise ControllerInputError(
                f"gait {gait.name!r}: clock = {gait.clock.tolist()}; legal where gaits are fitted: {CLOCK.tolist()}"
            )
        model, degree = library.model, max(library.degree, gait.alpha.shape[1] - 1)
        space = Parametrisation(model=model, degree=degree, step_length=None)
        middle = space.vector(gait)
        own = periodic_orbit(model, space.gait(middle))
        apart = middle - space.vector(library.gait(own.speed, own.step_length))
        speeds = _grid(library.speeds - own.speed)
        members, rates, momenta = [], [], []
        for faster in speeds:
            there = space.vector(library.gait(own.speed + faster, own.step_length))
            try:
                member = space.gait(there + _nearness(speeds, faster) * apart)
            except NoPosture as error:
                raise ControllerInputError(f"gait {gait.name!r}: no gaits to fit around it, {error}") from error
            orbit = periodic_orbit(model, member)
            members.append(with_rates(member, orbit))
            rates.append(np.polynomial.polynomial.polyfit(orbit.s, orbit.dtheta, DEGREE))
            momenta.append(-orbit.inertia[0] * orbit.dtheta[0] if orbit.exists else np.nan)
        rate, momentum = np.array(rates), np.array(momenta)
        if not (np.diff(momentum) > 0.0).all():
            raise ControllerInputError(
                f"gait {gait.name!r}: mixed with the gait library it has no orbit at some speeds; legal where gaits "
                "are fitted: a gait nearer to the library's"
            )
        # What the free numbers can not say of the own gait, such as the rounding of a printed table, goes with it too.
        at = int(np.flatnonzero(speeds == 0.0)[0])
        near = np.array([_nearness(speeds, faster) for faster in speeds])
        alpha = np.array([member.alpha for member in members])
        q_minus = np.array([member.q_minus for member in members])
        dq_minus = np.array([member.dq_minus for member in members])
        return cls(
            gait=gait,
            speed=own.speed,
            speeds=speeds,
            alpha=alpha + near[:, None, None] * (elevate(gait.alpha, degree) - alpha[at]),
            q_minus=q_minus + near[:, None] * (gait.q_minus - q_minus[at]),
            dq_minus=dq_minus + near[:, None] * (gait.dq_minus - dq_minus[at]),
            rate=rate - rate[at],
            momentum=momentum,
        )

    def member(self, faster: float) -> Gait:
        """The gait faster by so many [m/s], clipped to the family's range."""
        if faster == 0.0:
            return self.gait
        return Gait.of(
            name=self.gait.name,
            source=self.gait.source,
            alpha=self._mixed(self.alpha, faster),
            clock=self.gait.clock,
            q_minus=self._mixed(self.q_minus, faster),
            dq_minus=self._mixed(self.dq_minus, faster),
        )

    def rate_change(self, faster: float) -> Vector:
        """What a member's clock rate has over the own gait's in [rad/s], a polynomial of the normalised clock."""
        return self._mixed(self.rate, faster)

    def faster_by(self, momentum: float) -> float:
        """How much faster than its own gait a walker is that has this momentum after an impact.

        Args:
            momentum: About the new stance foot in [kg m^2/s], positive forward.

        Returns:
            In [m/s], within the family's range.
        """
        return float(np.interp(momentum, self.momentum, self.speeds))

    def _mixed(self, values: Vector, faster: float) -> Vector:
        faster = min(max(faster, self.speeds[0]), self.speeds[-1])
        cell = min(max(int(np.searchsorted(self.speeds, faster, side="right")) - 1, 0), len(self.speeds) - 2)
        weight = float((faster - self.speeds[cell]) / (self.speeds[cell + 1] - self.speeds[cell]))
        return (1.0 - weight) * values[cell] + weight * values[cell + 1]


def _grid(known: Vector) -> Vector:
    """From the slowest to the fastest library gait, 0 exactly among them."""
    slowest, fastest = float(known[0]), float(known[-1])
    if slowest == fastest:
        raise ControllerInputError("the gait library has one speed; legal where gaits are fitted: two or more")
    below = np.linspace(slowest, 0.0, int(np.ceil(-slowest / SPEED_STEP)) + 1)
    above = np.linspace(0.0, fastest, int(np.ceil(fastest / SPEED_STEP)) + 1)
    return np.concatenate((below, above[1:]))


def _nearness(speeds: Vector, faster: float) -> float:
    """1 at the own gait's speed, falling linearly to 0 at the ends of the grid."""
    return float(1.0 - faster / speeds[-1 if faster > 0.0 else 0]) if faster else 1.0
