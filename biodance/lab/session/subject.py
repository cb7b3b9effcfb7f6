"""Who is in the session: declared (session.toml, Vicon files, recordings), else guessed; every guess is said."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from biodance.display import spaced
from biodance.lab.markers.sets import landmark, read_marker_set
from biodance.lab.markers.upright import as_high_as_ever, on_the_ground, standing_mass
from biodance.lab.session.file import SubjectEntry
from biodance.records import SIDES, Array, Markers, Subject, Trial
from biodance.settings import CheckLimits

_SHARES = {
    ("head_front", "head_back"): ("the head markers", 0.897, 0.009),
    ("jugular_notch",): ("the jugular notch", 0.760, 0.013),
    ("c7",): ("C7", 0.798, 0.015),
    ("right_acromion", "left_acromion"): ("the acromia", 0.766, 0.014),
    ("right_asis", "left_asis"): ("the anterior iliac spines", 0.515, 0.029),
    ("right_knee_lateral", "left_knee_lateral"): ("the knees", 0.240, 0.039),
}
"""Landmarks with their name, their height over the lateral ankle markers as a share of the declared stature, and the
standard deviation of that share as a part of it, the surest first.

Measured on 25 people of 1.33 to 1.86 m in 8 laboratories, whose differences count (random effects; DerSimonian and
Laird 1986, doi:10.1016/0197-2456(86)90046-2): knees on 22, iliac spines 25, acromia 11, notch and C7 12, head 10.
"""
_ALIKE = 0.4
"""Correlation of the shares of two landmarks, the mean over the pairs: long legs lift all of them."""


def stature_of_markers(trial: Trial) -> tuple[float, float, str]:
    """Return the stature (m) of a standing person, its standard deviation (m) and of which markers it was told; NaN
    and "" where ankles or all else were not recorded.

    The mean of what each landmark tells, ``height over the ankles / share``, weighted by its precision; the standard
    deviation has the correlation of the landmarks in it. Left out one by one, the 25 people are told to 2.1 % (RMS),
    the 12 with markers of the upper trunk to 1.0 %.
    """
    at = _places(trial)
    ankles = _mean(at, tuple(f"{side}_ankle_lateral" for side in SIDES))
    # The share of the stature by which lifted arms raise the acromion markers, known to half: 2.6 % by arms lifted by
    # 90 degrees (45 mm at 1.75 m), in proportion to the angle (7 people with arms out, 6 with arms down).
    ends = [(f"{side}_elbow_lateral", f"{side}_acromion") for side in SIDES]
    arms = [at[elbow] - at[shoulder] for elbow, shoulder in ends if elbow in at and shoulder in at]
    angles = [math.degrees(math.acos(float(-arm[2] / np.linalg.norm(arm)))) for arm in arms]
    # Arms without a marker at the elbow are taken to be lifted by 45 degrees.
    rise = 0.026 * (float(np.mean(angles)) if angles else 45.0) / 90.0
    told, spread, names = [], [], []
    for landmarks, (name, share, sd) in _SHARES.items():
        height = _mean(at, landmarks)[2] - ankles[2]
        if math.isfinite(height) and height > 0:
            lifted = landmarks[0].endswith("acromion")
            told.append(height / (share + rise * lifted))
            spread.append(math.hypot(sd, rise / 2 / share * lifted))
            names.append(name)
    if not told:
        return math.nan, math.nan, ""
    sds = np.array(spread)
    # Inverse variances, as shares of one.
    weight = sds**-2 / (sds**-2).sum()
    # the sd of the mean has the correlation of the landmarks in it, though the weights have not
    covariance = np.outer(sds, sds) * (_ALIKE + (1 - _ALIKE) * np.eye(len(sds)))
    stature = float(weight @ told)
    return stature, stature * float(np.sqrt(weight @ covariance @ weight)), ", ".join(names)


def stature_of_movement(trial: Trial) -> tuple[float, float, str]:
    """Return the stature (m), its standard deviation (m) and of which markers it was told, as `stature_of_markers`, of
    somebody who moves: while both ankles are low and the iliac spines high; NaN and "" where that is never seen.
    """
    nothing = (math.nan, math.nan, "")
    if trial.markers is None or not trial.marker_set:
        return nothing
    worn, markers = read_marker_set(trial.marker_set), trial.markers
    wanted = [landmark(markers, worn, f"{side}_{part}") for part in ("ankle_lateral", "asis") for side in SIDES]
    heights = np.array([path[:, 2] for path in wanted if path is not None])
    if len(heights) < len(wanted) or np.isnan(heights).all(axis=1).any():
        return nothing
    high = heights[2:].mean(axis=0)
    upright = as_high_as_ever(high, np.asarray(on_the_ground(heights[:2]).all(axis=0)) & np.isfinite(high))
    # Ten such frames at least: on stairs both ankles are hardly ever low.
    if upright.sum() < 10:
        return nothing
    standing = Markers(markers.names, markers.time[upright], markers.xyz[upright])
    stature, sd, told_by = stature_of_markers(replace(trial, markers=standing))
    # Somebody who moves is lower by 1.8 % (sd 1.3) at the highest: the tallest trial of 12 people of 9 laboratories
    # (walks, squats, marching) against their static trial, -3.9 to -0.1 %.
    return stature / (1 - 0.018), math.hypot(sd, 0.013 * stature), told_by


def _places(trial: Trial) -> Mapping[str, Array]:
    """Return the median place (3,) m of every landmark that is needed and was recorded."""
    if trial.markers is None or not trial.marker_set:
        return {}
    marker_set = read_marker_set(trial.marker_set)
    sided = [f"{side}_{part}" for side in SIDES for part in ("ankle_lateral", "elbow_lateral")]
    found = {name: landmark(trial.markers, marker_set, name) for name in (*sum(_SHARES, ()), *sided)}
    seen = {name: path[np.isfinite(path).all(axis=1)] for name, path in found.items() if path is not None}
    return {name: np.median(path, axis=0) for name, path in seen.items() if len(path)}


def _mean(at: Mapping[str, Array], landmarks: tuple[str, ...]) -> Array:
    """Return the middle (3,) m of some landmarks; NaN if one of them was not recorded."""
    return np.mean([at.get(name, np.full(3, np.nan)) for name in landmarks], axis=0)


_DECLARED = {
    "mass": (("bodymass", "mass_kg", "mass", "weight"), (5.0, 400.0)),
    "stature": (("height", "stature", "height_m", "bodyheight"), (0.4, 2.6)),
    "sex": (("gender", "sex"), (0.0, 1.0)),
    "age": (("age",), (0.0, 120.0)),
}
"""What files declare of a person, in kg, m and years (sex: 0 woman, 1 man): its names, and the numbers that can be."""
_Declared = tuple[float, str]
"""One declared number and where it stands."""


def identify_subject(
    typed: SubjectEntry,
    files: Mapping[str, Mapping[str, float]],
    trials: Sequence[Trial],
    *,
    name: str,
    devices: Mapping[str, float],
) -> tuple[Subject, tuple[str, ...]]:
    """Return the subject and the notes: what was guessed, what contradicts what.

    ``typed`` is the table [subject] of session.toml and comes first; ``files`` are the measurements of .mp and .vsk
    files by file name, in m and kg; then come the measurements in the trials, the static one first. A mass that nobody
    declared is read from quiet standing on the plates; a stature from heights of markers over the ankles. What
    cannot be known stays NaN and a note says what to do. ``devices`` (kg by segment) come on top of a declared mass.
    """
    ordered = sorted(trials, key=lambda trial: trial.role != "static")
    sources = {**files, **{trial.source.path.name: trial.measurements for trial in ordered}}
    notes: list[str] = []
    mass = _choose("body mass", "kg", _declared(sources, "mass", typed.mass_kg), notes)
    mass = _with_devices(mass, devices, notes)
    stature = _choose("stature", "m", _declared(sources, "stature", typed.height_m), notes)
    told = next((value for value, _ in _declared(sources, "sex") if value in (0.0, 1.0)), None)
    declared: Literal["F", "M"] | None = None if told is None else "M" if told else "F"  # files hold it as 0 or 1
    sex = typed.sex or declared
    known = {"mass": math.isfinite(mass), "stature": math.isfinite(stature), "sex": sex is not None}
    on_plates = [(found, trial.name) for trial in ordered if (found := standing_mass(trial)) is not None]
    mass = _check_mass(mass, on_plates, notes)
    stature = stature if math.isfinite(stature) else _stature_of_markers(ordered, notes)
    mass = _middle_mass(mass, stature, trials, notes)
    age = _choose("age", "years", _declared(sources, "age", typed.age), [])
    if math.isnan(age):
        notes.append(
            "The age is not given: adult tables and limits are used (below 1.50 m with twice their standard "
            "deviations, as for a child). Set age in session.toml."
        )
    sex = sex or _likely_sex(stature, notes)
    measures = {name: value for values in reversed(sources.values()) for name, value in values.items()}
    guessed = tuple(what for what in known if not known[what])
    shape = (typed.girths, typed.scan or "", typed.scan_up or "z", typed.outlines)
    worn = typed.prosthesis or "", dict(devices)
    return Subject(mass, stature, sex, age, typed.name or name, measures, guessed, *shape, *worn), tuple(notes)


def declared(measurements: Mapping[str, float], what: str) -> float:
    """Return "mass" (kg) or "stature" (m) among the measurements of one file; NaN if it is not there, or no person's:
    outside 5 to 400 kg, or 0.4 to 2.6 m.
    """
    return next((value for value, _ in _declared({"": measurements}, what)), math.nan)


def _declared(sources: Mapping[str, Mapping[str, float]], what: str, typed: float | None = None) -> list[_Declared]:
    """Return what was ``typed`` in session.toml and what the sources declare (`_DECLARED`), in order, if legal."""
    found = [] if typed is None else [(typed, "session.toml")]
    names, (low, high) = _DECLARED[what]
    for source, values in sources.items():
        lower = {key.lower(): value for key, value in values.items()}
        value = next((lower[name] for name in names if name in lower), math.nan)
        if low <= value <= high:
            found.append((value, source))
    return found


def _choose(quantity: str, unit: str, declared: list[_Declared], notes: list[str]) -> float:
    """Return the first declared value, NaN without one, and note the first that contradicts it."""
    if not declared:
        return math.nan
    (first, source), *others = declared
    # Share by which two declared masses, or statures, may differ
    for other, elsewhere in [one for one in others if abs(one[0] - first) > 0.01 * first][:1]:
        notes.append(
            f"The {quantity} is {first:g} {unit} in {source} but {other:g} {unit} in {elsewhere}; the first was used. "
            "Are all files of the same person and day?"
        )
    return first


def _with_devices(mass: float, devices: Mapping[str, float], notes: list[str]) -> float:
    """Return the declared mass with what is worn, which the plates carry, too."""
    if not devices or math.isnan(mass):
        return mass
    worn = ", ".join(f"{kg:g} kg on the {spaced(segment)}" for segment, kg in devices.items())
    notes.append(f"{worn} are worn and come on top of the {mass:g} kg declared: {mass + sum(devices.values()):g} kg.")
    return mass + sum(devices.values())


def _check_mass(mass: float, on_plates: list[_Declared], notes: list[str]) -> float:
    """Return the declared mass, else the one on the plates; note the guess and what contradicts it."""
    if not on_plates:
        return mass
    if math.isnan(mass):
        mass, where = on_plates[0]
        notes.append(
            f"The body mass was not declared: {mass:.2f} kg were read from quiet standing on the plates in {where}."
        )
    far = [one for one in on_plates if abs(one[0] - mass) > CheckLimits.mass / 100 * mass]
    for other, where in far[:1]:
        notes.append(
            f"The plates carry {other:.2f} kg in quiet standing in {where}, but the body mass is {mass:.2f} kg. Check "
            "the entry, the plates, whether both feet stand on them, and whether it is the same person."
        )
    return mass


def _middle_mass(mass: float, stature: float, trials: Sequence[Trial], notes: list[str]) -> float:
    """Return the mass (kg); that of a middling person of this stature where nothing tells it and no plate is."""
    if math.isfinite(mass):
        return mass
    if math.isnan(stature) or any(trial.plates for trial in trials):
        notes.append(
            "The body mass was not declared, and nobody stands still on the plates. Set mass_kg in session.toml."
        )
        return mass
    # Body mass index, kg/m²: between the women (20.6) and the men (24.1) of de Leva 1996.
    mass = round(22.5 * stature**2, 1)
    notes.append(
        f"The body mass is not known: not declared, and no plate was recorded. {mass:g} kg were taken, as people of "
        f"{stature:.2f} m weigh; the movement does not depend on it, forces and loads do. Set mass_kg in session.toml."
    )
    return mass


def _stature_of_markers(trials: Sequence[Trial], notes: list[str]) -> float:
    """Return the stature (m) by the markers of a static trial, else of the tallest moving one; NaN if none."""
    _, (low, high) = _DECLARED["stature"]
    for trial in (t for t in trials if t.role == "static"):
        stature, sd, told_by = stature_of_markers(trial)
        if low <= stature <= high:
            notes.append(
                f"The stature was not declared: {stature:.2f} m (standard deviation {sd:.2f} m) were guessed from the "
                f"heights over the ankles of {told_by} in {trial.name}."
            )
            return stature
    moving = [(*stature_of_movement(t), t.name) for t in trials if t.role != "static"]
    known = [one for one in moving if low <= one[0] <= high]
    if not known:
        notes.append(
            "The stature is not known: it is not declared and neither a static trial nor anybody upright tells it. Set "
            "height_m in session.toml."
        )
        return math.nan
    stature, sd, told_by, name = max(known)
    notes.append(
        f"The stature was not declared: {stature:.2f} m (standard deviation {sd:.2f} m) were guessed from the heights "
        f"over the ankles of {told_by} while the person is upright in {name}: no static trial tells it."
    )
    return stature


def _likely_sex(stature: float, notes: list[str]) -> Literal["F", "M"]:
    """Return "M" from 1.70 m on and "F" below, which is right for most adults, and say so."""
    sex: Literal["F", "M"] = "M" if stature >= 1.70 else "F"
    known = f"a stature of {stature:.2f} m is more frequent among"
    basis, people = (
        known if math.isfinite(stature) else "without a stature people are taken for",
        "men" if sex == "M" else "women",
    )
    notes.append(f"The sex is not given: {basis} {people}, so tables for {sex} are used. Set sex in session.toml.")
    return sex
