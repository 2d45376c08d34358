"""A family of gaits around one, by speed: what the gait library says a change of speed means.

The walker follows a gait of its own, which need not be in the library. A member of the family is a library gait of
another speed and the same step length, plus a part of what sets the own gait apart from the library's at its own speed:
all of it there, so that the member is the gait itself, and none at the ends of the library, whose gaits are easy at
their speeds, which the own gait, sped up or slowed down, is not. The sum is taken in the free numbers of
`design.parameters`, where all sums are hybrid invariant, and has a speed of its own. The family ends where a sum has no
periodic orbit, needs more torque than there is, or stops getting slower or faster. Members are worked out on a grid
beforehand; between its points their coefficients are mixed, which takes microseconds.
"""

import math
from dataclasses import dataclass

import numpy as np

from controller.belief import Gait
from controller.common import polynomials
from controller.common.errors import UserError
from controller.common.records import Vector
from controller.design.orbit import Orbit, periodic_orbit
from controller.design.parameters import CLOCK, NoPosture, Parametrisation, elevate, with_rates
from controller.fitting.library import GaitLibrary

SPEED_STEP = 0.025  # [m/s] between members at most; mixtures of two miss hybrid invariance by 6e-4 rad/s
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
        """The family of a gait; takes about 0.2 s.

        Raises:
            UserError: the gait's clock is not the library's, its speed or step length are outside of the
                library, or the library's gaits cannot be mixed with it.
        """
        if not np.array_equal(gait.clock, CLOCK):
            raise UserError(
                f"gait {gait.name!r}: clock = {gait.clock.tolist()}; where gaits are fitted it must be {CLOCK.tolist()}"
            )
        model, degree = library.model, max(library.degree, gait.alpha.shape[1] - 1)
        space = Parametrisation(model=model, degree=degree, step_length=None)
        middle = space.vector(gait)
        own = periodic_orbit(model, space.gait(middle))
        apart = middle - space.vector(library.gait(own.speed, own.step_length))

        def outward(end: float) -> list[tuple[Gait, Orbit]]:
            """Members from the own speed to the library's end of it, up to the first that cannot be walked."""
            found: list[tuple[Gait, Orbit]] = []
            for away in np.linspace(0.0, 1.0, math.ceil(abs(end - own.speed) / SPEED_STEP) + 1):
                there = space.vector(library.gait((1.0 - away) * own.speed + away * end, own.step_length))
                try:
                    member = space.gait(there + (1.0 - away) * apart)
                except NoPosture:
                    break
                orbit = periodic_orbit(model, member)
                if not orbit.exists or (np.abs(orbit.u).max(axis=0) > model.torque_limits).any():
                    break
                if found and not _further(found[-1][1], orbit, sign=end - own.speed):
                    break
                found.append((with_rates(member, orbit), orbit))
            return found

        slower, faster = outward(float(library.speeds[0])), outward(float(library.speeds[-1]))
        members, at = slower[:0:-1] + faster, len(slower) - 1
        speeds = np.array([orbit.speed - own.speed for _, orbit in members])
        if len(members) < 2:
            raise UserError(
                f"gait {gait.name!r}: mixed with the gait library it gives no other gaits; where gaits are "
                "fitted it must be nearer to the library's"
            )
        speeds[at] = 0.0  # the own gait's to the bit
        momentum = np.array([_momentum(orbit) for _, orbit in members])
        alpha = np.array([member.alpha for member, _ in members])
        q_minus = np.array([member.q_minus for member, _ in members])
        dq_minus = np.array([member.dq_minus for member, _ in members])
        rate = np.array([polynomials.fit(orbit.s, orbit.dtheta, DEGREE) for _, orbit in members])
        # What the free numbers cannot say of the own gait, such as the rounding of a printed table, fades likewise.
        near = np.concatenate((np.linspace(0.0, 1.0, at + 1), np.linspace(1.0, 0.0, len(members) - at)[1:]))
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


def _momentum(orbit: Orbit) -> float:
    """About the stance foot after the impact in [kg m^2/s], positive forward."""
    return float(-orbit.inertia[0] * orbit.dtheta[0])


def _further(last: Orbit, orbit: Orbit, sign: float) -> bool:
    """Whether an orbit is faster (or slower, for a negative sign) than the last, by its speed and its momentum."""
    return sign * (orbit.speed - last.speed) > 0.0 and sign * (_momentum(orbit) - _momentum(last)) > 0.0
