"""Two plates carry each other's channels: cables or channel lists are exchanged."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations

import numpy as np

from biodance.effects._base.quality_check import DiscreteEffect, QualityCheck, Recorded
from biodance.effects._base.words import ACCEPT, About, CauseWords, SessionEntry
from biodance.errors import BiodanceError
from biodance.lab.markers.sets import read_marker_set
from biodance.lab.prepare import prepare
from biodance.motion.soles import Soles, distance_to_hull, soles_from_markers
from biodance.records import Array, Plate, Trial, Wrench
from biodance.settings import COP_FORCE
from biodance.spatial import wrench_about_origin, wrench_about_point

_AWAY = 0.10
"""m from the nearest sole: no pressure lies so far from the foot that makes it; markers of a sole and corners of plates
are wrong by some centimetres at most."""
_BETTER = 0.3
"""Share of that distance that the exchange must leave at most, on either plate."""
_FRAMES = 50
"""Frames of a trial that are looked at."""
_LOADED = 5 * COP_FORCE
"""N from which on the place of a pressure is known to a centimetre."""

_Pair = tuple[str, str]


class PlatesExchanged(DiscreteEffect):
    """Two plates whose pressures lie under the feet only once their channels are exchanged."""

    name = "plates_exchanged"
    separated_by = "Stand on one plate only: the other one must read nothing."
    advice = "Exchange the cables, or the channels in FORCE_PLATFORM:CHANNEL, and export again."
    about = About(
        what="Two plates carry each other's channels: cables or channel lists are exchanged.",
        signature=(
            "The pressure of each lies where no foot stands, and under the feet once the two are exchanged; the total"
            " force is right."
        ),
        look_alikes=(
            "A plate that lies elsewhere (its pressure is off alone), exchanged left and right feet (which stand on "
            "their plates all the same)."
        ),
        settled_by="Standing on one plate only.",
    )
    words = CauseWords(
        "{it} carry each other's signals",
        f"Exchange them{ACCEPT}",
        "exchanged plates",
        entry=SessionEntry.CHANNELS,
    )

    @classmethod
    def check(cls, recorded: Recorded) -> tuple[QualityCheck, ...]:
        """Return the pairs that are exchanged, with the trials in which they are, where not in all that tell."""
        told = {trial.name: pairs for trial in recorded.session.trials if (pairs := _pairs(trial))}
        where: dict[_Pair, list[str]] = {}
        for name, pairs in told.items():
            for pair in (pair for pair, wrong in pairs.items() if wrong):
                where.setdefault(pair, []).append(name)
        if told and not where:
            return (QualityCheck("channels of the plates", True, "No two plates carry each other's channels."),)
        failed = []
        for pair, names in where.items():
            trials = () if names == [name for name in told if pair in told[name]] else tuple(names)
            text = f"The pressures of {pair[0]} and {pair[1]} lie under the feet only once their channels are exchanged"
            text += f", in {', '.join(names)}." if trials else "."
            check = QualityCheck("channels of the plates", False, text, cls.name, "/".join(pair), trials=trials)
            failed.append(check)
        return tuple(failed)

    @classmethod
    def undone(cls, trial: Trial, found: QualityCheck) -> Trial:
        """Return the trial with the channels of the two plates exchanged."""
        first, last = found.target.split("/")
        return with_channels_exchanged(trial, first, last)


def with_channels_exchanged(trial: Trial, first: str, last: str) -> Trial:
    """Return a trial in which two plates have each other's channels; as it is where it lacks one of them.

    What a plate's channels read, in its own axes about its centre, is taken as read by the other one.
    """
    plates = {plate.name: plate for plate in trial.plates}
    if first not in plates or last not in plates:
        return trial
    a, b = plates[first], plates[last]
    swapped = {first: _read_by(a, b), last: _read_by(b, a)}
    return replace(trial, plates=tuple(swapped.get(plate.name, plate) for plate in trial.plates))


def _read_by(plate: Plate, other: Plate) -> Plate:
    """Return ``plate`` with what the channels of the ``other`` one read."""
    # Plate axes to plate axes: as the other plate's amplifier would have read them.
    turn = _axes(plate) @ _axes(other).T
    local = wrench_about_point(other.wrench.value, other.centre)
    value = wrench_about_origin(np.hstack([local[:, :3] @ turn.T, local[:, 3:] @ turn.T]), plate.centre)
    return replace(plate, wrench=Wrench(other.wrench.time, value), zero=turn @ other.zero)


def _axes(plate: Plate) -> Array:
    """Return the axes of a plate (3, 3), in columns, as the order of its corners says them (C3D manual)."""
    one, two, three, four = plate.corners
    # C3D: corners 1 and 4 lie at positive x, 1 and 2 at positive y.
    x = (one + four - two - three) / np.linalg.norm(one + four - two - three)
    z = np.cross(x, one + two - three - four)
    z /= np.linalg.norm(z)
    return np.stack([x, np.cross(z, x), z], axis=1)


def _pairs(trial: Trial) -> dict[_Pair, bool]:
    """Return for every two plates whose pressures are known whether they are exchanged; {} without feet."""
    if trial.markers is None or not trial.marker_set or sum(plate.placed for plate in trial.plates) < 2:
        return {}
    try:
        one = prepare(trial)
        assert one.markers is not None
        soles = soles_from_markers(one.markers, read_marker_set(one.marker_set))
    except BiodanceError:
        return {}
    return dict(_told(one, soles))


def _told(trial: Trial, soles: Soles) -> Iterator[tuple[_Pair, bool]]:
    for a, b in combinations([plate for plate in trial.plates if plate.placed], 2):
        now = [_distance(plate, soles) for plate in (a, b)]
        if not all(np.isfinite(now)):
            continue
        then = [_distance(_read_by(*pair), soles) for pair in ((a, b), (b, a))] if min(now) > _AWAY else now
        yield (a.name, b.name), all(y < _BETTER * x for x, y in zip(now, then, strict=True))


def _distance(plate: Plate, soles: Soles) -> float:
    """Return how far the plate's pressure lies from the soles, m, the median while it is loaded; NaN without load."""
    cop = plate.wrench.cop(height=plate.height)[:, :2]
    loaded = np.abs(plate.wrench.force[:, 2]) > _LOADED
    here = np.flatnonzero(loaded & np.isfinite(cop).all(axis=1) & np.isfinite(soles.outline).all(axis=(1, 2, 3)))
    if not here.size:
        return float("nan")
    here = here[np.linspace(0, here.size - 1, min(_FRAMES, here.size)).astype(int)]
    each = [distance_to_hull(cop[here], soles.outline[here, foot, :, :2]) for foot in range(2)]
    return float(np.median(np.min(each, axis=0)))


EFFECT = PlatesExchanged
