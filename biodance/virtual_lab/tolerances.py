"""How far reality is from the ideal in the virtual laboratory, everywhere between the bone and the file: the truth that
is drawn from.

Numbers, units and sources are the rows "virtual" of ``anthropometry/uncertainty/sizes.csv``. "Prototype" there is the
set of sizes with which synthetic sessions behaved like real ones; sensor numbers are from makers' sheets and from
in-situ measurements. Every tolerance can be set to zero alone (``dataclasses.replace``); ``PERFECT`` has all of them at
zero.
"""

from dataclasses import dataclass, fields, replace

from biodance.body.tables.anthropometry import error_rows


@dataclass(frozen=True)
class LabTolerances:
    """Standard deviations of what is drawn for a person, a session and a trial (SI units, radians); all >= 0."""

    # the person: drawn once from the person's seed
    segment_mass: float
    side_mass: float
    segment_shape: float
    com: float
    segment_length: float
    joint_centre: float
    joint_axis: float
    # the motion
    head_motion: float
    thorax_motion: float
    thorax_share: float
    wrist_motion: float
    clavicle_rhythm: float
    girdle_motion: float
    performance: float
    tremor: float
    sway: float
    breathing: float
    # the skin
    marker_placement: float
    soft_tissue: float
    soft_tissue_day: float
    # the cameras
    camera_noise: float
    camera_wander: float
    gaps_per_minute: float
    lab_tilt: float
    measure: float
    scale: float
    # the plate
    plate_position: float
    plate_rotation: float
    plate_gain: float
    plate_crosstalk: float
    plate_offset: float
    plate_noise: float
    plate_delay: float


REALISTIC = LabTolerances(**{row["quantity"]: float(row["sd"]) for row in error_rows(whose="virtual")})
PERFECT = LabTolerances(**{f.name: 0.0 for f in fields(LabTolerances)})


def instruments_perfect(tolerances: LabTolerances = REALISTIC) -> LabTolerances:
    """Return the tolerances with a perfect plate, perfect cameras and bone-fixed markers, but an unchanged person
    and motion.
    """
    from_skin_on = [f.name for f in fields(LabTolerances)][
        list(LabTolerances.__dataclass_fields__).index("marker_placement") :
    ]
    return replace(tolerances, **dict.fromkeys(from_skin_on, 0.0))
