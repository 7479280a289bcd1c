"""The records of which a design is made.

Every key of a design file stands here once, with its dimension, range, default and a line of description that ends with
the coherent unit.
"""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BaseModel, Field

from fem_biobot.design_kinds import (
    AmplitudeBy,
    Angle,
    Attachment,
    Coefficient,
    Concentration,
    Consumption,
    Convention,
    Coordinate,
    Density,
    Diffusivity,
    Eccentric,
    Element,
    Fatigue,
    Force,
    ForceLength,
    Fraction,
    Frequency,
    Gain,
    GammaScales,
    GelFace,
    Grading,
    Immersion,
    Law,
    Layout,
    LinearSystems,
    Modulus,
    NonNegativeTime,
    OdditySet,
    OptionalCoefficient,
    OptionalCoordinate,
    OptionalDiffusivity,
    OptionalFrequency,
    OptionalModulus,
    OptionalNumber,
    OptionalPositive,
    OptionalShare,
    OptionalText,
    OptionalThird,
    OptionalTime,
    OptionalTransfer,
    OptionalViscosity,
    OxygenUse,
    PartLength,
    Poisson,
    PositiveConcentration,
    PositiveLength,
    PositiveTime,
    Quantity,
    Rate,
    Reference,
    Seeding,
    SignedAngle,
    SignedModulus,
    Spread,
    SpreadKind,
    Switch,
    Tension,
    Training,
    WalkerStart,
    Waveform,
)


class Record(BaseModel, frozen=True, extra="forbid", strict=True):
    """Frozen, refuses unknown names and wrong types."""


class Material(Record, frozen=True):
    """Passive material."""

    law: Law = Field(default="neo_hooke", description="Constitutive law")
    young: Modulus = Field(description="Young's modulus at small strain [kPa]")
    poisson: Poisson = Field(description="Poisson's ratio at small strain [1]")
    density: Density = Field(description="Mass per reference volume [kg/mm^3]")
    second_share: OptionalShare = Field(default=None, description="mooney_rivlin: c2 over c1 + c2 [1]")
    c2: SignedModulus = Field(default=None, description="yeoh: coefficient of the square [kPa]")
    c3: OptionalModulus = Field(default=None, description="yeoh: coefficient of the cube [kPa]")
    chain_limit: OptionalPositive = Field(default=None, description="gent: I1 - 3 at which chains are drawn out [1]")
    exponent_fibre: OptionalPositive = Field(default=None, description="guccione: exponent along the fibre [1]")
    exponent_across: OptionalPositive = Field(default=None, description="guccione: exponent across the fibre [1]")
    exponent_shear: OptionalPositive = Field(default=None, description="guccione: exponent of shear along it [1]")
    fibre_modulus: OptionalModulus = Field(default=None, description="holzapfel_ogden: modulus of the fibres [kPa]")
    fibre_exponent: OptionalPositive = Field(
        default=None, description="holzapfel_ogden, blemker: exponent of the fibres' stiffening [1]"
    )
    fibre_dispersion: OptionalThird = Field(
        default=None, description="holzapfel_ogden: 0 for parallel fibres, 1/3 for random ones [1]"
    )
    ground: OptionalNumber = Field(default=None, description="blemker: stiffness of slack fibres over E [1]")
    fibre_peak: OptionalModulus = Field(default=None, description="blemker: stress that scales the fibres [kPa]")
    fibre_onset: OptionalNumber = Field(default=None, description="blemker: scale of the exponential, P1 [1]")
    optimal_stretch: OptionalPositive = Field(default=None, description="blemker: stretch where fibres begin [1]")
    straight_stretch: OptionalPositive = Field(
        default=None, description="blemker: stretch beyond which their tension rises in a straight line [1]"
    )


class Skeleton(Record, frozen=True):
    """Hydrogel beam with pillars at its ends."""

    beam_length: PositiveLength = Field(description="Whole length of the beam along x, pillars included [mm]")
    beam_width: PositiveLength = Field(description="Width of the beam along y [mm]")
    beam_thickness: PositiveLength = Field(description="Thickness of the beam along z [mm]")
    pillar_count: int = Field(default=2, description="Number of pillars, equally spaced from end to end [1]")
    pillar_length: PartLength = Field(default=0.0, description="Extent of a pillar along x [mm]")
    pillar_width: PartLength = Field(default=0.0, description="Extent of a pillar along y [mm]")
    short_pillar_height: PartLength = Field(
        default=0.0, description="From the beam axis to the short pillar's sole [mm]"
    )
    long_pillar_height: PartLength = Field(default=0.0, description="From the beam axis to the long pillar's sole [mm]")
    fillet_radius: PartLength = Field(default=0.0, description="Radius where a pillar's inner face meets the beam [mm]")
    material: Material = Field(description="Hydrogel")


class Oxygen(Record, frozen=True):
    """Supply and use of oxygen, from which the viable share of the tissue follows; sources in `muscle.oxygenation`."""

    tension: OxygenUse = Field(
        default="field",
        description="What the viable share does to the tension: field, scales it point by point in the solid and by "
        "its mean over the section in the rods; section, by that mean in both; none, it is reported only",
    )
    supply: PositiveConcentration = Field(default=0.2, description="Oxygen in the medium [mM]")
    diffusivity: Diffusivity = Field(default=1.7e-3, description="Of oxygen in the tissue [mm^2/s]")
    consumption: Consumption = Field(default=6.7e-4, description="Largest use of oxygen per tissue volume [mM/s]")
    half_saturation: PositiveConcentration = Field(
        default=8e-3, description="Oxygen at which half of the largest use is left [mM]"
    )
    threshold: Concentration = Field(default=2e-3, description="Oxygen below which tissue is not viable [mM]")
    film: OptionalTransfer = Field(
        default=None, description="Transfer through the medium's boundary film; none for a well-stirred medium [mm/s]"
    )
    gel: GelFace = Field(default="sealed", description="Whether oxygen reaches the muscle through the gel")
    gel_diffusivity: OptionalDiffusivity = Field(
        default=None, description="Of oxygen in a permeable gel, to be given with it [mm^2/s]"
    )


class Tissue(Record, frozen=True):
    """How tissue was seeded, from which a junction's section and tension follow; laws in `muscle.compaction` and
    `muscle.maturation`.
    """

    seeded_width: Annotated[float, Quantity("mm", 3.5, 14.0, note="compaction was measured up to there")] = Field(
        description="Width of the trench that it was seeded in [mm]"
    )
    days: Annotated[float, Quantity("1", 5.0, 15.0, note="forces were measured up to there")] = Field(
        default=15.0, description="Age of the tissue in days [1]"
    )
    seeding: Seeding = Field(default="myotubes", description="What it was seeded with")
    seeded_depth: PositiveLength = Field(default=0.4, description="Depth of the trench [mm]")
    volume_kept: Annotated[float | None, Quantity("1", 0.0, 1.0, low_open=True)] = Field(
        default=None, description="Share of the seeded volume that is left; left out, the thickness stays the depth [1]"
    )


class ForceVelocity(Record, frozen=True):
    """How stimulated tension depends on the rate of stretch, where there is time: Hill's hyperbola; sources and
    assumptions in `material.force_velocity`.
    """

    fastest: Rate = Field(description="Unloaded shortening in rest lengths a second, of native muscle about 10 [1/s]")
    curvature: Gain = Field(default=0.25, description="Hill's a / F0: the smaller, the more curved [1]")
    eccentric: Eccentric = Field(default=1.4, description="Bound of the force in lengthening over the isometric [1]")


class ActivationField(Record, frozen=True):
    """Where and when the muscle is stimulated: one of a formula, a table and a picture. The standing tension stays."""

    formula: str = Field(
        default="",
        description="Share of the stimulated tension as a formula in x, y, z (reference position in mm), t (s) and pi, "
        "such as where(x > 0, 1, 0)",
    )
    table: str = Field(
        default="", description="CSV file beside the design with columns x, y, z (mm; some may be absent), activation"
    )
    image: str = Field(default="", description="Grey PNG or TIFF file beside the design, laid over the x-y plane")
    image_left: OptionalCoordinate = Field(default=None, description="x of the picture's left edge [mm]")
    image_right: OptionalCoordinate = Field(default=None, description="x of its right edge [mm]")
    image_bottom: OptionalCoordinate = Field(default=None, description="y of its lower edge [mm]")
    image_top: OptionalCoordinate = Field(default=None, description="y of its upper edge [mm]")
    instant: NonNegativeTime = Field(default=0.0, description="The t at which states are solved [s]")


class Muscle(Record, frozen=True):
    """Muscle tissue, its fibres and its tension."""

    layout: Layout = Field(
        default="junction",
        description="junction: rings joined by a thin strip between the pillars; ring: one loop around both",
    )
    junction_length: PartLength = Field(
        default=0.0, description="Length of a strip along x; a bot's follows from its span [mm]"
    )
    junction_width: PartLength = Field(default=0.0, description="Width of the junction along y [mm]")
    junction_thickness: PartLength = Field(default=0.0, description="Thickness of the junction along z [mm]")
    junction_height: Coordinate = Field(description="z of the muscle's mid-plane above the longest pillar's sole [mm]")
    ring_thickness: PartLength = Field(default=0.0, description="In-plane thickness of the ring around a pillar [mm]")
    ring_height: PartLength = Field(default=0.0, description="Extent of the ring along z [mm]")
    ring_offset: Coordinate = Field(default=0.0, description="z of the ring's mid-plane minus the junction's [mm]")
    attachment: Attachment = Field(
        default="bonded",
        description="bonded: tissue grown onto its pillars; contact: rings lie on them, press, lift off and slide",
    )
    pillar_friction: OptionalCoefficient = Field(
        default=None, description="contact: Coulomb coefficient between ring and pillar, to be given with it [1]"
    )
    pillar_axial_friction: OptionalCoefficient = Field(
        default=None, description="contact: that against sliding along the pillar; pillar_friction if left out [1]"
    )
    reference: Reference = Field(
        default="as_moulded",
        description="as_moulded: stress-free at pillar spacing; remodelled: stress-free in the passive shape",
    )
    theta: Angle = Field(description="Angle from the lateral axis to the fibre; 90 deg is along the machine [rad]")
    fibres: str = Field(
        default="piecewise",
        description="smooth: follow the walls and turn smoothly into the junction; piecewise: jump where ring and "
        "junction meet; else a file: a table of points with angles or vectors, or a picture of angles",
    )
    spread: Spread = Field(default=0.0, description="Standard deviation of the fibre angle in a picture [rad]")
    orientation: OptionalText = Field(
        default=None,
        description="Table of directions or picture of fibres, beside this file, that gives theta and spread",
    )
    orientation_image: OptionalText = Field(default=None, description="Which image of that table, if it has several")
    orientation_axis: SignedAngle = Field(
        default=0.0, description="Direction of the machine's x axis in that picture, up from its right [rad]"
    )
    spread_kind: SpreadKind = Field(
        default="planar",
        description="How fibres spread: planar and planar_von_mises in the muscle's plane, solid about their mean",
    )
    gamma: Fraction = Field(default=1.0, description="Viable fraction; scales the tension [1]")
    gamma_scales: GammaScales = Field(
        default="both", description="What gamma scales: both tensions, or the active one alone"
    )
    passive_tension: Tension = Field(description="Standing tension of the compacted tissue along the fibre [kPa]")
    active_tension: Tension = Field(description="Tension that stimulation adds at full drive [kPa]")
    convention: Convention = Field(
        default="nominal",
        description="nominal: force per reference area; second_piola: times the stretch s; kirchhoff: over s; cauchy: "
        "per current area; active_strain: the tissue's natural length shrinks instead",
    )
    force_length: ForceLength = Field(
        default="none",
        description="How the stimulated tension depends on the fibre's stretch: none, or a curve of native muscle",
    )
    optimal_stretch: OptionalPositive = Field(
        default=None, description="Stretch of greatest force of that curve, 1 if left out [1]"
    )
    transverse: Fraction = Field(default=0.0, description="Tension across the fibres over that along them [1]")
    tissue: Tissue | None = Field(
        default=None, description="How the tissue was seeded, in place of its section and tension"
    )
    force_velocity: ForceVelocity | None = Field(
        default=None, description="How the stimulated tension depends on the rate of the fibre's stretch"
    )
    activation: ActivationField | None = Field(default=None, description="Stimulation that is not the same everywhere")
    oxygen: Oxygen | None = Field(default=None, description="Oxygen, where it decides on the viable share")
    material: Material = Field(description="Tissue without its tension")


class Drive(Record, frozen=True):
    """Stimulation over time."""

    waveform: Waveform = Field(
        default="abs_sine",
        description="abs_sine: amplitude |sin(pi f t)|; constant: the amplitude at all times; pulse: rectangular; "
        "rc_biphasic: two phases that decay through the electrode; twitch: measured twitches, summed",
    )
    frequency: Frequency = Field(default=2.0, description="Strokes per second: pulses, or bursts of them [Hz]")
    duration: PositiveTime = Field(default=5.0, description="Stimulated time [s]")
    amplitude: Fraction = Field(
        default=1.0, description="Largest drive, of a twitch its peak; 1 adds the whole active tension [1]"
    )
    pulse_width: OptionalTime = Field(default=None, description="pulse: of a pulse; rc_biphasic: of a phase [s]")
    rc_time: OptionalTime = Field(default=None, description="rc_biphasic: time of the decay within a phase [s]")
    pulses: int = Field(default=1, description="pulse, rc_biphasic, twitch: stimuli in a burst [1]")
    pulse_rate: OptionalFrequency = Field(default=None, description="Stimuli per second within a burst [Hz]")
    amplitude_by: AmplitudeBy = Field(
        default="given",
        description="How the amplitude depends on the frequency, as a factor that is 1 at 2 Hz: given, not at all; "
        "paper_2018, the paper's simulated forces; drennan_2025, twitches of C2C12 rings",
    )
    training: Training = Field(
        default="none",
        description="Published gain in force: ito_2014, 4.5 by pulses at 1 Hz until day 14; kim_2019, 1.31 by 20 min "
        "of electrical and mechanical stimulation in turn",
    )
    exercise: Gain = Field(default=1.0, description="Further gain in force, an assumption of the user [1]")
    fatigue: Fatigue = Field(
        default="given",
        description="How force falls while driven: by fatigue_time and fatigue_rest, or as that of native fast or slow "
        "mouse muscle under hard stimulation (Cairns et al. 2009)",
    )
    fatigue_time: OptionalTime = Field(
        default=None, description="Time constant with which force falls while driven, an assumption of the user [s]"
    )
    fatigue_rest: Fraction = Field(default=0.0, description="Share of the force that fatigue leaves in the end [1]")


class Ground(Record, frozen=True):
    """Surface and surroundings."""

    static_friction: Coefficient = Field(default=0.42, description="Coulomb coefficient of a sticking foot [1]")
    kinetic_friction: Coefficient = Field(default=0.3, description="Coulomb coefficient of a sliding foot [1]")
    immersion: Immersion = Field(default="air", description="submerged: buoyancy reduces the weight; air: it does not")
    medium_density: Density = Field(default=1e-6, description="Density of the medium when submerged [kg/mm^3]")
    viscosity: OptionalViscosity = Field(
        default=None, description="Viscosity of the medium when submerged, for drag; none if left out [kPa s]"
    )


class MeshSettings(Record, frozen=True):
    """How the body is divided."""

    size: PositiveLength = Field(description="Edge length asked of the mesh generator away from refinement [mm]")
    grading: Grading = Field(
        default="even",
        description="even: finer in thin parts and corners; closing: finer where the tips' closing is decided, of "
        "elements half again as long along y; at half again the size fewer unknowns and a smaller error of the "
        "closing; edges: finer along the pillars' edges that unbonded rings wrap around",
    )
    element: Element = Field(
        default="P2",
        description="P2: quadratic tetrahedra, displacement only; P2-P1: with a linear pressure, for ratios up to 0.5",
    )


class Numerics(Record, frozen=True):
    """Settings of the solvers."""

    step: PositiveTime = Field(default=1e-3, description="Time step of the dynamics [s]")
    largest_error: Annotated[float | None, Quantity("mm", 0.0, low_open=True)] = Field(
        default=None, description="Error that rods allow a step, made in parts that keep to it; left out, any [mm]"
    )
    damping_time: NonNegativeTime = Field(
        default=1e-4, description="Kelvin-Voigt time of gel and tissue: stress per rate over stress per strain [s]"
    )
    tolerance: Annotated[float, Quantity("1", 1e-13, 1e-3)] = Field(
        default=1e-9, description="Residual relative to the force scale at which an equilibrium is accepted [1]"
    )
    linear: LinearSystems = Field(
        default="auto",
        description="Linear systems of the solid: direct factors the matrix, iterative (mesh.element P2 only) that of "
        "the linear tetrahedra alone; auto: iterative for large meshes, where it is faster and needs less memory",
    )


class Load(Record, frozen=True):
    """Load of a cantilever."""

    tip_force: Force = Field(description="Force along z, spread over the tip face [mN]")


def _switch(description: str) -> Any:
    return Field(default="as_set", description=f"{description}; as_set: as the set of oddities says")


class Walker(Record, frozen=True):
    """The walker of the published open rod code: which of its oddities it has, its muscles' force, how it begins."""

    oddities: OdditySet = Field(default="as_published", description="Set of oddities from which single ones depart")
    start: WalkerStart = Field(
        default="standing",
        description="standing: at rest with the base force; published: from the drawing, base force growing from 0.1 s",
    )
    base_force: Annotated[float, Quantity("mN", 0.0)] = Field(
        default=0.2, description="Tension of every fibre and ring at rest [mN]"
    )
    active_force: Annotated[float, Quantity("mN", 0.0)] = Field(
        default=0.6, description="What full drive adds to it [mN]"
    )
    doubled_shear: Switch = _switch("Shear modulus E / (1 + nu)")
    halved_beam: Switch = _switch("Half of the beams' mass")
    smeared_step: Switch = _switch("Bending stiffness averaged where the flexible span ends")
    yielding_joints: Switch = _switch("Legs turn on the beam against springs and dashpots")
    stiff_fibres: Switch = _switch("Fibres as stiff as rings")
    leg_node_contact: Switch = _switch("Rings push the legs' nodes 3 and 4, whatever their height")
    centred_reaction: Switch = _switch("The ground's force acts on the foot's middle without moment")
    friction_twice: Switch = _switch("Twice the friction")
    absolute_damping: Switch = _switch("Drag against rest instead of damping of strains")
    floating_muscle: Switch = _switch("Gravity acts on the skeleton alone, and rings float at a fixed height")
    overlapping_ends: Switch = _switch("Rings overlap by two elements that hang free")
