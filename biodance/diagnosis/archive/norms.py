"""What is usual in a laboratory: how quiet its instruments are, how its people stand, what its witnesses see."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from biodance.diagnosis.archive.conditions import pool
from biodance.observations import observe, recording
from biodance.records import Array, Trial
from biodance.uncertainty.session_noise import SkinUnrest, camera_noise, plate_noise
from biodance.uncertainty.tolerances import InstrumentNoise


@dataclass(frozen=True)
class Norm:
    """What is usual of one thing: the ``value`` that sessions share with its ``sd``, the standard deviation ``between``
    sessions, of ``sessions`` and ``observations``.
    """

    name: str
    value: float
    sd: float
    between: float
    unit: str
    sessions: int
    observations: int


@dataclass(frozen=True)
class SeenValue:
    """One number that one ``session`` shows of ``name``."""

    name: str
    session: str
    value: float
    unit: str
    sd: float = float("nan")


def sway(cop: Array) -> float:
    """Return how far the centre of pressure ``cop`` (T, 2) m of quiet standing strays, m root mean square."""
    return float(np.sqrt(np.var(cop, axis=0).sum()))


def noise_of_instruments(trials: Sequence[Trial], distance: float, skin: SkinUnrest) -> InstrumentNoise:
    """Return how quiet the recordings of a session are; ``distance`` m of a typical marker to the moving body, NaN
    where nothing moved; ``skin`` its `skin_unrest`.
    """
    markers = [one.markers for one in trials if one.markers is not None and one.markers.time.size > 1]
    density = plate_noise(plate for one in trials for plate in one.plates)
    far = distance if distance > 0 else float("nan")
    waves, swing = (tuple(one.tolist()) for one in skin.sizes())
    return InstrumentNoise(camera_noise(markers), tuple(density.tolist()), far, waves, swing)


def usual_noise(found: Sequence[InstrumentNoise]) -> InstrumentNoise:
    """Return the middle of several sessions; what none shows is that which comes with biodance."""
    usual = InstrumentNoise()
    parts = ([getattr(one, part) for one in found] for part in ("plate", "skin", "swing"))
    plates, skins, swings = (zip(*part, strict=True) for part in parts)
    return InstrumentNoise(
        _middle([one.camera for one in found], usual.camera),
        tuple(map(_middle, plates, usual.plate)),
        _middle([one.marker_distance for one in found], usual.marker_distance),
        tuple(map(_middle, skins, usual.skin)),
        tuple(map(_middle, swings, usual.swing)),
    )


def _middle(some: Sequence[float], usual: float) -> float:
    """Return the median of the sessions that show a size; the ``usual`` one where none does."""
    return float(np.median([one for one in some if one > 0] or [usual]))


def seen_by_witnesses(trials: Sequence[Trial], session: str, mass: float) -> list[SeenValue]:
    """Return what the witnesses of a session see beyond what they expect, each kind of observation by its name."""
    found = []
    for trial in trials:
        for one in observe(recording(trial, mass=mass)) if trial.plates else ():
            found.append(SeenValue(one.kind, session, one.value - one.expected, one.unit, one.sd))
    return found


def norms(found: Sequence[SeenValue]) -> tuple[Norm, ...]:
    """Return what is usual of everything that two sessions or more show, by name."""
    names: dict[str, dict[str, list[SeenValue]]] = {}
    for one in found:
        names.setdefault(one.name, {}).setdefault(one.session, []).append(one)
    return tuple(_norm(name, sessions) for name, sessions in sorted(names.items()) if len(sessions) > 1)


def _norm(name: str, sessions: Mapping[str, Sequence[SeenValue]]) -> Norm:
    """Return what is usual of one thing: medians of the sessions, pooled."""
    value = np.array([np.median([one.value for one in some]) for some in sessions.values()])
    # Standard error of the mean of a session.
    known = np.array([np.mean([one.sd for one in some]) / np.sqrt(len(some)) for some in sessions.values()])
    scatter = max(float(np.std(value, ddof=1)), 1e-12)
    shared = pool(value, np.where(np.isfinite(known), known, 0.1 * scatter))
    count = sum(len(some) for some in sessions.values())
    unit = next(iter(sessions.values()))[0].unit
    return Norm(name, shared.mean, shared.sd, float(np.std(value, ddof=1)), unit, len(sessions), count)
