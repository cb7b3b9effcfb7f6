"""How far reality is from the ideal, everywhere between the bone and the file: one record, each number with its source.

"Prototype" below is the set of sizes with which synthetic sessions behaved like real ones; sensor numbers are from makers' sheets and from
in-situ measurements. Every tolerance can be set to zero alone (``dataclasses.replace``); ``PERFECT`` has all of them at zero.
"""

from dataclasses import dataclass, fields, replace


@dataclass(frozen=True)
class Tolerances:
    """Standard deviations of what is drawn for a person, a session and a trial (SI units, radians); all >= 0."""

    # the person: drawn once from the person's seed
    segment_mass: float = 0.14  # relative, spread between anthropometric tables (de Leva 1996, Dumas 2018, Zatsiorsky)
    side_mass: float = 0.04  # relative, right against left; lean-mass asymmetry of healthy adults is a few per cent
    segment_shape: float = 0.07  # relative stretch and shear of the density: 14 % in the inertia
    com: float = 0.08  # of the segment's own spread: about 10 mm for a thigh, as tables differ among themselves
    segment_length: float = 0.03  # relative, after scaling to the stature
    joint_centre: float = 0.004  # m per axis; 3-5 mm beyond what the regression methods err by themselves
    joint_axis: float = 0.035  # rad per axis: 2 degrees
    # the motion
    head_motion: float = 0.044  # rad rms per axis: 2.5 degrees on two axes, unseen by a model with a rigid head
    thorax_motion: float = 0.021  # rad rms per axis: 1.2 degrees on two axes, unseen by a one-piece trunk
    thorax_share: float = 0.06  # of the trunk's angles is bent above the lumbar joint (the subject keeps the back straight)
    wrist_motion: float = 0.052  # rad rms: 3 degrees of wrist and of forearm pronation
    clavicle_rhythm: float = 0.02  # rad of clavicle elevation per rad of arm elevation; 7 mm of shoulder lift at 130 degrees
    girdle_motion: float = 0.0  # rad rms of each clavicle beyond that rhythm; 0.1 rad carry the shoulder by 15 mm
    performance: float = 0.05  # relative amplitude and timing of every posture: nobody repeats a dance exactly
    tremor: float = 0.004  # rad rms below 1.5 Hz on every joint: a quiet posture is not still
    sway: float = 0.004  # m rms of the centre of pressure, quiet standing of young adults
    breathing: float = 0.006  # rad of the thorax at 0.25 Hz; 0.1 N in Fz
    # the skin
    marker_placement: float = 0.004  # m per axis along the skin
    soft_tissue: float = 1.0  # times the coefficients of soft_tissue.py (3-10 mm over a dance; Leardini 2005, Zemp 2014)
    soft_tissue_day: float = 0.5  # share of the soft-tissue coefficients' variance that is drawn anew each session
    # the cameras
    camera_noise: float = 0.0001  # m per axis, independent from frame to frame (Vicon, static: below 0.025 mm, Merriaux 2017)
    camera_wander: float = 0.0003  # m rms per axis, slower than 1 Hz: calibration and lens (static 0.15 mm, dynamic < 2 mm, Merriaux 2017)
    gaps_per_minute: float = 1.0  # of the marker trajectories together; each 0.05-0.30 s long
    lab_tilt: float = 0.0017  # rad of the cameras' vertical: 0.1 degree
    measure: float = 0.004  # m, tape and calliper errors of the typed measurements
    scale: float = 0.05  # kg, bathroom-scale error of the declared mass
    # the plate
    plate_position: float = 0.0015  # m per axis: corners measured with a wand
    plate_rotation: float = 0.0026  # rad per axis: 0.15 degree (CalTester reports about 0.2)
    plate_gain: float = 0.003  # relative per channel
    plate_crosstalk: float = 0.001  # of the full-scale ratio of two channels; makers' limits 0.05-0.2 % (corrected plates)
    plate_offset: float = 0.5  # N in Fz after zeroing; other channels in proportion of their full scale
    plate_noise: float = 0.7  # N in Fz per sample at 1000 Hz (2.5 mV raw); other channels in proportion of their full scale
    plate_delay: float = 0.001  # s: the force samples are this much late (fixed, not a standard deviation)


REALISTIC = Tolerances()
PERFECT = Tolerances(**{f.name: 0.0 for f in fields(Tolerances)})


def instruments_perfect(tolerances: Tolerances = REALISTIC) -> Tolerances:
    """Return the tolerances with a perfect plate, perfect cameras and bone-fixed markers, but an unchanged person and motion."""
    from_skin_on = [f.name for f in fields(Tolerances)][list(Tolerances.__dataclass_fields__).index("marker_placement") :]
    return replace(tolerances, **dict.fromkeys(from_skin_on, 0.0))
