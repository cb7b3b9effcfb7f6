"""Two markers carry each other's names: left and right, front and back of the wrist, for a whole session or from one
trial on.

Signature: both markers are far from the model, each where the other one should be. Look-alikes: a marker that fell off
(one of the two is right then). Separated by exchanging the two names: only then does the body fit.
"""

import numpy as np

from biodance.body.body import Body
from biodance.effects._base.case import Case
from biodance.effects._base.gate import DiscreteEffect, Gate, Recorded
from biodance.errors import BiodanceError
from biodance.motion.ik.inverse_kinematics import solve_ik
from biodance.records import Array, Markers, Trial

_FAR = 0.04
"""m: RMS distance from which on a marker is suspected."""
SUSPECTS = 4
_FRAMES = 8
CASES = 2
"""At most so many suspects of so many trials are exchanged, in so many frames: a body that does not fit is slow to
track.
"""
ROUGH = 1e-3
"""m, tolerance of the trial trackings."""
BETTER = 0.3
"""Share of the squared distances that the exchange must leave at most."""
OPPOSITE = 0.4
"""Cosine: how opposite one wrist must be to the mirrored other one."""
_LEAST = 0.03
"""m by which a left marker must lie to the right of its right partner in the static trial."""


class LabelsSwapped(DiscreteEffect):
    """Two labels whose exchange makes the markers fit the body, or a left marker on the right side of its partner."""

    name = "labels_swapped"
    separated_by = "Exchange the two names: the body fits, or it does not."
    advice = "Exchange the two labels in the recording software, in every trial named, and export again."

    @classmethod
    def look(cls, recorded: Recorded) -> tuple[Gate, ...]:
        """Return the pairs found in the static trials by their sides, and in the others by exchanging suspects."""
        found: dict[tuple[str, str], list[str]] = {}
        statics = [trial for trial in recorded.session.trials if trial.role == "static" and trial.markers is not None]
        for trial in statics:
            for pair in (*crossed(trial), *turned_wrists(trial)):
                found.setdefault(pair, []).append(trial.name)
        for case in () if found else _worst(recorded.cases):
            for pair in exchanged(case):
                found.setdefault(pair, []).append(case.trial.name)
        if found:
            return tuple(
                Gate(
                    "labels of the markers",
                    False,
                    f"{a} and {b} carry each other's names in {', '.join(where)}.",
                    cls.name,
                    f"{a}/{b}",
                )
                for (a, b), where in found.items()
            )
        looked = bool(statics or recorded.cases)
        return (
            (Gate("labels of the markers", True, "No two markers seem to carry each other's names."),) if looked else ()
        )


def partner(name: str) -> str:
    """Return the label of the same place on the other side; "" for a midline marker."""
    other = {"L": "R", "R": "L", "l": "r", "r": "l"}.get(name[:1], "")
    return other + name[1:] if other else ""


def crossed(trial: Trial) -> tuple[tuple[str, str], ...]:
    """Return the pairs of left and right markers that lie on each other's side of the body, against the majority of
    pairs.
    """
    markers = trial.markers
    assert markers is not None
    pairs = [(name, partner(name)) for name in markers.names if name[:1] in "Ll" and partner(name) in markers]
    if len(pairs) < 5:
        return ()
    with np.errstate(invalid="ignore"):
        apart = np.array([_median(markers[left] - markers[right]) for left, right in pairs])
    apart[:, 2] = 0.0
    known = np.isfinite(apart).all(axis=1)
    if known.sum() < 5:
        return ()
    strongest = np.linalg.svd(apart[known])[2][0]
    along = apart @ strongest
    leftwards = along * np.sign(np.nansum(np.sign(along)))
    return tuple(pair for pair, side in zip(pairs, leftwards, strict=True) if side < -_LEAST)


def turned_wrists(trial: Trial) -> tuple[tuple[str, str], ...]:
    """Return the wrists whose thumb-side marker (WRA) lies behind and inside of the other one (WRB) while the person
    stands, against the mirrored other wrist.
    """
    markers = trial.markers
    assert markers is not None
    needed = [f"{side}{name}" for side in "LR" for name in ("WRA", "WRB", "TOE", "HEE")]
    if any(name not in markers for name in needed):
        return ()
    middle = {name: _median(markers[name]) for name in needed}
    forward = sum((middle[f"{side}TOE"] - middle[f"{side}HEE"] for side in "LR"), np.zeros(3)) * [1, 1, 0]
    across = (middle["RHEE"] - middle["LHEE"]) * [1, 1, 0]
    if not (np.isfinite(forward).all() and np.linalg.norm(forward) > 0.1 and np.linalg.norm(across) > _LEAST):
        return ()
    forward /= np.linalg.norm(forward)
    right = np.array([forward[1], -forward[0], 0.0])
    out = {}
    for side, sign in (("L", -1.0), ("R", 1.0)):
        bar = middle[f"{side}WRA"] - middle[f"{side}WRB"]
        out[side] = np.array([bar @ forward, sign * (bar @ right)]) / max(float(np.linalg.norm(bar)), 1e-9)
    if out["L"] @ out["R"] > -OPPOSITE:
        return ()
    wrong = min(out, key=lambda side: float(out[side].sum()))
    return ((f"{wrong}WRA", f"{wrong}WRB"),)


def _median(values: Array) -> Array:
    """Return the median (3,) over the frames (T, 3) in which a distance is known; NaN without any."""
    seen = values[np.isfinite(values).all(axis=1)]
    return np.asarray(np.median(seen, axis=0)) if len(seen) else np.full(3, np.nan)


def _worst(cases: tuple[Case, ...]) -> list[Case]:
    """Return the trials whose markers are farthest from the body, at most CASES."""
    return sorted(
        cases, key=lambda case: -float(np.nanmean(case.motion.residual**2)) if case.motion.residual.size else 0.0
    )[:CASES]


def exchanged(case: Case) -> tuple[tuple[str, str], ...]:
    """Return the pairs of far markers of a trial whose exchange makes the body fit."""
    squares = np.where(np.isfinite(case.motion.residual), case.motion.residual, 0.0) ** 2
    far = np.sqrt(squares.mean(axis=0)) if len(squares) else np.zeros(0)
    order = [int(k) for k in np.argsort(-far)[:SUSPECTS] if far[k] > _FAR]
    if len(order) < 2 or case.trial.markers is None:
        return ()
    frames = np.unique(np.linspace(0, case.motion.time.size - 1, _FRAMES).astype(int))
    names = [case.motion.marker_names[k] for k in order]
    pairs = sorted(
        ((a, b) for i, a in enumerate(names) for b in names[i + 1 :]), key=lambda pair: partner(pair[0]) != pair[1]
    )
    before = _misfit(case.body, case.trial.markers, frames)
    for pair in pairs:
        if _misfit(case.body, _renamed(case.trial.markers, pair), frames) < BETTER * before:
            return ((min(pair), max(pair)),)
    return ()


def _misfit(body: Body, markers: Markers, frames: Array) -> float:
    """Return the mean square distance (m²) of some frames' markers to the body; infinite where they do not determine
    it.
    """
    some = Markers(markers.names, markers.time[frames], markers.xyz[frames])
    try:
        return float(np.nanmean(solve_ik(body, some, tolerance=ROUGH).residual ** 2))
    except BiodanceError:
        return float("inf")


def _renamed(markers: Markers, pair: tuple[str, str]) -> Markers:
    """Return the markers with two names exchanged."""
    other = {pair[0]: pair[1], pair[1]: pair[0]}
    return Markers(tuple(other.get(name, name) for name in markers.names), markers.time, markers.xyz)


EFFECT = LabelsSwapped
