"""Both legs as one: what the file says of the left and the right must agree, or be made to where asked."""

import math

from sim.walkers.planar import Coordinate, Given, PlanarJoint, PlanarLink
from sim.walkers.skeleton import Body
from sim.walkers.table import Table
from sim.walkers.tree import Joint

SAME = 1e-6  # relative: legs so equal are equal
UNEVEN = 0.05  # legs farther apart are never made equal


class Pairs:
    """Makes one of every pair.

    Attributes:
        uneven: Largest share by which legs were made equal so far.
    """

    def __init__(self, given: Given, table: Table) -> None:
        """Args: given: What the file does not say; table: of the conversion."""
        self.given, self.table = given, table
        self.uneven = 0.0

    def joint(self, roles: tuple[str, str], legs: dict[str, Body], coordinates: dict[str, Coordinate]) -> PlanarJoint:
        """The joints of both legs as one."""
        found = []
        for role in roles:
            joint, map_ = legs[role].joint, coordinates[role]
            assert joint is not None
            ends = sorted(map_.ours(value) if math.isfinite(value) else map_.sign * value for value in _ends(joint))
            found.append(
                {
                    "torque": joint.effort,
                    "damping": joint.damping,
                    "friction": joint.friction,
                    "rotor": joint.rotor,
                    "stiffness": joint.stiffness,
                    "rest": map_.ours(joint.rest) if joint.stiffness else 0.0,
                    "low": ends[0],
                    "high": ends[1],
                }
            )
        kind = roles[0].partition("_")[2]
        given = self.given.torque
        if given is not None:
            torque = given[0 if kind == "hip" else 1]
            said = [f"{side['torque']:g}" for side in found]
            said = ["none" if s == "nan" else s for s in said]
            self.table.row(f"torque limit, {kind}s", f"{said[0]} and {said[1]} N.m", f"{torque:g} N.m", "given")
            for side in found:
                side["torque"] = torque
        elif not all(side["torque"] > 0.0 for side in found):
            self.table.row(f"torque limit, {kind}s", "none in the file", "--torque HIP KNEE", "must be given")
            for side in found:
                side["torque"] = 1.0
        for key, unit in (
            ("torque", "N.m"), ("damping", "N.m.s/rad"), ("friction", "N.m"), ("rotor", "kg m^2"),
            ("stiffness", "N.m/rad"), ("rest", "rad"), ("low", "rad"), ("high", "rad"),
        ):  # fmt: skip
            a, b = found[0][key], found[1][key]
            if a < 0.0 and key not in ("rest", "low", "high"):
                self.table.outside(f"{kind}s", f"{key} {a:g} {unit}", "not below 0")
            if key in ("low", "high"):
                if a != b and not abs(a - b) <= SAME:
                    one = max(a, b) if key == "low" else min(a, b)
                    self.table.row(
                        f"{kind}s", f"{key} stops at {a:.4g} and {b:.4g} rad, ours", f"{one:.4g} rad for both"
                    )
                    found[0][key] = one
            elif a != b and not abs(a - b) <= SAME * max(1.0, abs(a), abs(b)):
                legal = "equal legs" + ("; or --torque HIP KNEE" if key == "torque" else "")
                self.table.outside(f"{kind}s", f"{key} {a:g} and {b:g} {unit}", legal)
        both = found[0]
        for key, name, unit in (
            ("friction", "dry friction", "N.m"),
            ("stiffness", "a spring of", "N.m/rad"),
            ("rotor", "rotor inertia", "kg m^2"),
        ):
            if both[key]:
                self.table.row(f"{kind}s", f"{name} {both[key]:g} {unit}", "taken over", "as it is")
        if math.isfinite(both["low"]) or math.isfinite(both["high"]):
            span = f"{both['low']:.4g} to {both['high']:.4g} rad in our coordinates"
            self.table.row(f"{kind}s", f"stops, {span}", "taken over", "as it is")
        return PlanarJoint(**both)

    def link(self, pair: list[PlanarLink], what: str) -> PlanarLink:
        """One link of a pair: they are equal, or made so where asked."""
        a, b = pair
        for key, unit in (
            ("mass", "kg"), ("length", "m"), ("com", "m"), ("com_across", "m"), ("inertia", "kg m^2"),
        ):  # fmt: skip
            x, y = getattr(a, key), getattr(b, key)
            share = abs(x - y) / max(abs(x), abs(y), 1e-3)
            if share <= SAME:
                continue
            self.uneven = max(self.uneven, share)
            found = f"{key} {x:.6g} and {y:.6g} {unit}, {100 * share:.2g} % apart"
            if self.given.even_legs and share <= UNEVEN:
                self.table.row(what, found, f"{0.5 * (x + y):.6g} {unit} for both", "given")
            else:
                more = f"; or --even-legs, up to {100 * UNEVEN:g} %" if share <= UNEVEN else ""
                self.table.outside(what, found, f"equal legs: the exchange of legs rests on them{more}")
        if not self.uneven:
            return a
        keys = ("mass", "length", "com", "com_across", "inertia")
        return PlanarLink(**{key: 0.5 * (getattr(a, key) + getattr(b, key)) for key in keys})


def _ends(joint: Joint) -> tuple[float, float]:
    return joint.low, joint.high
