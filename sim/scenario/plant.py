"""Settings of the true walker and its world: integration, ground, modelling errors."""

import dataclasses
import math
from dataclasses import dataclass
from typing import Annotated, Literal

from controller.common.units import (
    FRACTION,
    NOT_NEGATIVE,
    POSITIVE,
    SLOPE,
    Metre,
    PositiveRatio,
    Radian,
    Range,
    Ratio,
    Second,
    Unit,
    whole,
)
from sim.errors import UserError
from sim.scenario.per_link import (
    BodyFactors,
    BodyLengths,
    BodyMasses,
    JointFactors,
    JointInertias,
    JointTorques,
    LimbFactors,
)

FRICTION = Range(low=0.0, high=100.0, words="between 0 and 100")  # rubber on concrete has 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Ramp:
    """A stretch of ground with an inclination of its own; behind it the ground goes on at the new height.

    Attributes:
        start: Where it begins.
        length: Its horizontal length.
        slope: Inclination, positive uphill, added to what is there.
    """

    slope: Annotated[Radian, SLOPE]
    start: Metre = 1.0
    length: Annotated[Metre, POSITIVE] = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Ledge:
    """A step in the ground, with a vertical face.

    Attributes:
        height: Rise; negative for a step down.
        position: Where it is.
        count: Number of equal ledges, a stair.
        spacing: Distance from one to the next.
    """

    height: Metre
    position: Metre = 1.0
    count: Annotated[int, Unit("ledges"), whole(1, 1000)] = 1
    spacing: Annotated[Metre, POSITIVE] = 0.4


@dataclass(frozen=True, slots=True, kw_only=True)
class Patch:
    """A stretch of ground with a friction of its own.

    Attributes:
        friction: Coulomb friction coefficient on it.
        start: Where it begins.
        length: Its length.
    """

    friction: Annotated[Ratio, FRICTION]
    start: Metre = 1.0
    length: Annotated[Metre, POSITIVE] = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class RoughSettings:
    """Random rough ground: heights drawn anew for each seed, joined by straight facets.

    Attributes:
        height: Heights are uniform between minus and plus this; 0 for smooth ground.
        spacing: Horizontal length of a facet.
        start: Where the roughness begins.
    """

    height: Annotated[Metre, NOT_NEGATIVE] = 0.0
    spacing: Annotated[Metre, POSITIVE] = 0.1
    start: Metre = 0.2


@dataclass(frozen=True, slots=True, kw_only=True)
class GroundSettings:
    """The floor.

    Attributes:
        friction: Coulomb friction coefficient between foot and floor.
        slope: Inclination, positive uphill. The walker starts in the gait's posture, whose rear foot is then above
            the ground or in it; a ramp that begins further on has no such start.
        stiffness_factor: Factor on the stiffness of the contact.
        damping_factor: Factor on the damping of the contact.
        ramps: Stretches with an inclination of their own.
        ledges: Steps up and down.
        patches: Stretches with a friction of their own; where two overlap the later one counts.
        rough: Random rough ground.
    """

    friction: Annotated[Ratio, FRICTION] = 0.6
    slope: Annotated[Radian, SLOPE] = 0.0
    stiffness_factor: PositiveRatio = 1.0
    damping_factor: PositiveRatio = 1.0
    ramps: tuple[Ramp, ...] = ()
    ledges: tuple[Ledge, ...] = ()
    patches: tuple[Patch, ...] = ()
    rough: RoughSettings = dataclasses.field(default_factory=RoughSettings)

    @property
    def is_plane(self) -> bool:
        """Whether one infinite plane is all there is."""
        return not (self.ramps or self.ledges or self.patches or self.rough.height)


@dataclass(frozen=True, slots=True, kw_only=True)
class ContactSettings:
    """Numerics of MuJoCo's contact, for asking what depends on them; the rigid plant has none of them.

    Attributes:
        cone: Friction cone; "model" for that of the walker's file.
        impratio: Ratio of frictional to normal impedance; none for that of the file.
        time_constant: First number of the feet's solref; none for that of the file.
        impedance: First number of the feet's solimp, their least impedance; none for that of the file. The second is
            raised where it would be below.
        foot_radius: Radius of the feet's spheres; none for that of the file.
    """

    cone: Literal["model", "elliptic", "pyramidal"] = "model"
    impratio: Annotated[float | None, Unit("ratio"), POSITIVE] = None
    time_constant: Annotated[float | None, Unit("s"), POSITIVE] = None
    impedance: Annotated[float | None, Unit("ratio"), FRACTION] = None
    foot_radius: Annotated[float | None, Unit("m"), POSITIVE] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class PlantSettings:
    """The true walker and its world; what differs from the model here, the controller does not know.

    Attributes:
        kind: MuJoCo with contact, or the paper's ideal walker: pinned stance foot, rigid instantaneous impact.
        scuff: What a swing foot that passes below the ground without landing is, which the rigid ground does not stop:
            reported, as in an ideal simulation, or a fall once it is deeper than an eight-hundredth of the leg (1 mm).
        timestep: Physics step; a whole number of them makes a control period.
        integrator: MuJoCo's integrator.
        saturation: Whether the motors saturate at their torque limits.
        ground: The floor.
        contact: Numerics of the contact.
        mass_factor: Factors on the links' masses.
        mass_offset: Masses added to the links, after the factor.
        inertia_follows_mass: Whether a link's rotational inertia changes in proportion to its mass.
        inertia_factor: Factors on rotational inertia about the centre of mass, whatever the mass does.
        com_offset_along: Displacement of the centres of mass along the links, positive away from the hip
            (the torso's: towards the head).
        com_offset_across: Displacement across the links, along x of the link's own frame: forward for the
            torso held upright, backward for a leg that hangs down.
        length_factor: Factors on the lengths of femurs and tibias; centres of mass stay where they are.
        damping_factor: Factors on joint damping.
        joint_friction: Coulomb friction in the joints, added to the model's own; on the rigid plant smooth about rest.
        joint_friction_factor: Factors on the model's own friction in the joints.
        armature: Rotor inertia reflected to the joints, added to the model's own.
        armature_factor: Factors on the model's own rotor inertia.
        stiffness_factor: Factors on the stiffness of the model's springs in the joints.
        joint_limits: Whether the model's joint stops stop.
        torque_limit_factor: Factors on the motors' torque limits.
    """

    kind: Literal["mujoco", "rigid"] = "mujoco"
    scuff: Literal["report", "trip"] = "report"
    timestep: Annotated[Second, POSITIVE] = 0.25e-3
    integrator: Literal["implicitfast", "RK4", "implicit", "Euler"] = "implicitfast"
    saturation: bool = True
    ground: GroundSettings = dataclasses.field(default_factory=GroundSettings)
    contact: ContactSettings = dataclasses.field(default_factory=ContactSettings)
    mass_factor: BodyFactors = dataclasses.field(default_factory=BodyFactors)
    mass_offset: BodyMasses = dataclasses.field(default_factory=BodyMasses)
    inertia_follows_mass: bool = True
    inertia_factor: BodyFactors = dataclasses.field(default_factory=BodyFactors)
    com_offset_along: BodyLengths = dataclasses.field(default_factory=BodyLengths)
    com_offset_across: BodyLengths = dataclasses.field(default_factory=BodyLengths)
    length_factor: LimbFactors = dataclasses.field(default_factory=LimbFactors)
    damping_factor: JointFactors = dataclasses.field(default_factory=JointFactors)
    joint_friction: JointTorques = dataclasses.field(default_factory=JointTorques)
    joint_friction_factor: JointFactors = dataclasses.field(default_factory=JointFactors)
    armature: JointInertias = dataclasses.field(default_factory=JointInertias)
    armature_factor: JointFactors = dataclasses.field(default_factory=JointFactors)
    stiffness_factor: JointFactors = dataclasses.field(default_factory=JointFactors)
    joint_limits: bool = True
    torque_limit_factor: JointFactors = dataclasses.field(default_factory=JointFactors)


WHOLE_TOLERANCE = 1e-9  # relative, for "a whole number of substeps"


def whole_substeps(timestep: float, period: float) -> int:
    """Number of physics steps of `timestep` in a control period, both in [s].

    Raises:
        UserError: it is no whole number.
    """
    if not (math.isfinite(timestep) and timestep > 0.0):
        raise UserError(f"plant.timestep = {timestep} s: must be positive")
    ratio = period / timestep
    substeps = max(1, round(ratio)) if math.isfinite(ratio) else 1
    if abs(ratio - substeps) > WHOLE_TOLERANCE * substeps:
        legal = [period / n for n in (math.ceil(ratio), math.floor(ratio)) if n] if math.isfinite(ratio) else [period]
        raise UserError(
            f"plant.timestep = {timestep} s: must divide controller.period = {period} s a whole number of times; "
            f"the nearest legal values are {' and '.join(f'{value:.6g} s' for value in legal)}"
        )
    return substeps
