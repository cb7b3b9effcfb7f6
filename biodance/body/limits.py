"""Joint ranges, speeds and torques of the human by sex, age, mass and stature."""

from math import isnan
from typing import Literal

import numpy as np

from biodance.body.body import JointLimits
from biodance.body.tables import Table, numbers, read_table
from biodance.records import Array, Subject
from biodance.settings import STANDARD_GRAVITY

REFERENCE_MASS = {"F": 65.0, "M": 75.0}
"""kg: the bodies for which joints_23.csv gives torques; other bodies in proportion to mass."""
Range = Literal["anatomical", "comfortable"]

# Anderson's joint and direction -> movement and sign in the model; the ankle flexes (dorsiflexion) upwards
_ANDERSON = {
    ("hip", "flexion"): ("hip_flexion", 1),
    ("hip", "extension"): ("hip_flexion", -1),
    ("knee", "flexion"): ("knee_flexion", 1),
    ("knee", "extension"): ("knee_flexion", -1),
    ("ankle", "flexion"): ("ankle_dorsiflexion", 1),
    ("ankle", "extension"): ("ankle_dorsiflexion", -1),
}


def joint_limits(subject: Subject, *, within: Range = "anatomical") -> JointLimits:
    """Return the limits of the 23 joints of a person.

    ``within="anatomical"`` is what a healthy adult's joint allows (for inverse kinematics), ``"comfortable"`` what he or she reaches
    without effort (for designed motions). Speed 4 rad/s (Bonnet 2016). Torques: hip flexion, knee and ankle dorsiflexion from Anderson 2007
    (C1 * mass * g * stature) by sex and age; all others from ``joints_23.csv`` in proportion to body mass, times the same age factor
    (mean over Anderson's six torques against 18-25 years). Unknown age counts as 25.
    """
    table = read_table("human", "joints_23")
    low, high = {"anatomical": ("range_min_deg", "range_max_deg"), "comfortable": ("comfort_min_deg", "comfort_max_deg")}[within]
    word = {"F": "woman", "M": "man"}[subject.sex]
    ranges = np.radians([numbers(row, f"{low} {high}") for row in table.rows])
    velocity = [float(row["velocity_rad_s"]) for row in table.rows]
    torque = np.array([numbers(row, f"torque_min_{word}_Nm torque_max_{word}_Nm") for row in table.rows])
    anderson = read_table("human", "anderson_2007")
    torque *= subject.mass / REFERENCE_MASS[subject.sex] * age_factor(anderson, subject)
    names = [row["joint"].split("_", 1)[1] for row in table.rows]
    for (joint, direction), (movement, sign) in _ANDERSON.items():
        peak = peak_torque(anderson, subject, joint, direction)
        for i, name in enumerate(names):
            if name == movement:
                torque[i, (sign + 1) // 2] = sign * peak
    return JointLimits(ranges[:, 0], ranges[:, 1], np.array(velocity), torque[:, 0], torque[:, 1])


def peak_torque(anderson: Table, subject: Subject, joint: str, direction: str) -> float:
    """Return the largest isometric torque, N·m > 0: C1 * mass * g * stature, C1 linear in age between 25, 60 and 70 years."""
    return _coefficient(anderson, subject, joint, direction) * subject.mass * STANDARD_GRAVITY * subject.stature


def age_factor(anderson: Table, subject: Subject) -> float:
    """Return the strength at the subject's age against 18-25 years, mean over Anderson's six torques of the same sex."""
    ratios = [
        _coefficient(anderson, subject, joint, direction) / _groups(anderson, subject.sex, joint, direction)[0]
        for joint, direction in _ANDERSON
    ]
    return float(np.mean(ratios))


def _groups(anderson: Table, sex: str, joint: str, direction: str) -> Array:
    rows = anderson.where(joint=joint, direction=direction, sex=sex)
    return np.array([float(row["C1"]) for row in rows])


def _coefficient(anderson: Table, subject: Subject, joint: str, direction: str) -> float:
    age = 25.0 if isnan(subject.age) else subject.age
    return float(np.interp(age, [25.0, 60.0, 70.0], _groups(anderson, subject.sex, joint, direction)))
