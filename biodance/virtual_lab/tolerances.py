"""How far reality is from the ideal in the virtual laboratory, everywhere between the bone and the file: the truth that
is drawn from, and the reproducible random streams and smooth random motions that draw it.

Numbers, units and sources are the rows "virtual" of ``anthropometry/uncertainty/sizes.csv``. "Prototype" there is the
set of sizes with which synthetic sessions behaved like real ones; sensor numbers are from makers' sheets and from
in-situ measurements. Every tolerance can be set to zero alone (``dataclasses.replace``); ``PERFECT`` has all of them at
zero.
"""

from dataclasses import dataclass, fields
from zlib import crc32

import numpy as np

from biodance.body.tables.error_sizes import error_rows
from biodance.records import Array


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


def stream(seed: int, *purpose: str) -> np.random.Generator:
    """Return the random stream of one ``purpose``: drawing more numbers for one purpose never changes another."""
    return np.random.default_rng([seed, *(crc32(word.encode()) for word in purpose)])


def smooth_noise(rng: np.random.Generator, time: Array, *, columns: int, cutoff: float) -> Array:
    """Return smooth random curves (T, columns) of zero mean and unit expected standard deviation.

    ``time`` (T,) s, equidistant; ``cutoff`` Hz: the amplitude spectrum falls as exp(-(f / cutoff)²), so all derivatives
    exist. The number of draws depends on the duration and the cutoff, not on the sampling rate.
    """
    duration = 2.0 * (time[-1] - time[0]) + 1.0
    frequency = np.arange(1, int(np.ceil(3.0 * cutoff * duration)) + 1) / duration
    weight = np.exp(-((frequency / cutoff) ** 2))
    weight /= np.sqrt(np.sum(weight**2))
    cosine, sine = rng.normal(size=(2, frequency.size, columns)) * weight[None, :, None]
    phase = 2 * np.pi * np.outer(time, frequency)
    return np.cos(phase) @ cosine + np.sin(phase) @ sine
