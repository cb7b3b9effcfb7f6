"""Is the size of a named cause constant? That of a true cause is the same in every trial, second, band and channel,
under every load and at every place. The size of a look-alike depends on something: an offset fitted to cross-talk grows
with the load, a cross-talk fitted to an offset decreases with it.

The trace of the cause is multiplied by each of these signals, and the score test (`evidence`) tests whether the product
is present in the residual, with all tolerances and the sizes of all named causes free to adapt.

The trace of a cause in proportion to the wrench that the movement needs (`Effect.in_proportion`) has the movement's
errors in it, and so has the residual, with the other sign: in a fast band, where they are a good part of the wrench,
the size comes out too small (errors in variables). What was measured, with the named causes off, has none of them, but
every error of the plates. The size lies between those that the two traces show (the bounds of Frisch 1934; Klepper and
Leamer 1984, doi:10.2307/1911466), and the score nearest to zero counts.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from biodance.diagnosis.adequacy import LIMIT
from biodance.diagnosis.candidates import removed
from biodance.diagnosis.model import Model, NamedCause, unlike
from biodance.diagnosis.naming import cause_key
from biodance.diagnosis.problem import Problem
from biodance.diagnosis.screening import absorbed
from biodance.records import CHANNELS, Array
from biodance.uncertainty.bands import BANDS

_SAME = 1e-6
"""Share of the largest trace that must be left of one beside everything else, to be asked about at all."""
_STEP = 0.1
"""m of place, as wide as a foot."""


@dataclass(frozen=True)
class SizeDependence:
    """Dependence of a named cause's size on something: ``cause`` (effect, target), ``over`` the variable, ``share`` the
    relative change of the size (for twice the load, 0.1 m of place, the whole time; in one channel, band or trial),
    ``z`` its distance from zero in standard deviations. These include the model error of the cause
    (`Tolerances.model_error`), and by how much its wrench is `unlike` its model.
    """

    cause: tuple[str, str]
    over: str
    share: float
    z: float


def size_dependences(found: Model) -> tuple[SizeDependence, ...]:
    """Return the dependence of every named cause's size on load, place, time, trial, band and channel, most significant
    first.

    Transient contacts have no single size and are left out.
    """
    rows = [one for named in found.named if not named.course for one in _of_one(found, named)]
    return tuple(sorted(rows, key=lambda one: -abs(one.z)))


def significant_dependences(found: Model) -> dict[tuple[str, str], SizeDependence]:
    """Return the strongest dependence of every named cause whose size is not constant (beyond `LIMIT` standard
    deviations).
    """
    beyond: dict[tuple[str, str], SizeDependence] = {}
    for one in size_dependences(found):
        if abs(one.z) > LIMIT:
            beyond.setdefault(one.cause, one)
    return beyond


def changes_wrench(found: Model, named: NamedCause) -> bool:
    """Return whether a cause changes any channel of the wrench by a relevant amount, or is shown by the markers."""
    return bool(found.problem.felt(removed(found.problem, named.effect, named.theta)[:, None])[0] >= 1.0)


def _of_one(found: Model, named: NamedCause) -> Iterator[SizeDependence]:
    over, columns = zip(*_traces(found.problem, named), strict=True)
    Z = found.white(np.stack(columns, axis=1))
    half = found.posterior.half(found.posterior.X.T @ Z)
    s, alone = Z.T @ found.posterior.residual, np.sum(Z**2, axis=0) - np.sum(half**2, axis=0)
    other = s + _lost_to_errors(found, named, over)
    s = np.where(s * other > 0, np.where(np.abs(s) < np.abs(other), s, other), 0.0)
    poor = max(unlike(named.effect), found.tolerances.model_error(named.effect.name))
    least = _SAME * float(np.sum(Z**2, axis=0).max())
    seen = alone - np.sum(absorbed(found, Z, half) ** 2, axis=0)
    for name, score, own in zip(over, s, seen, strict=True):
        if own > least:
            share, sd = float(score / own), float(np.hypot(own**-0.5, poor))
            yield SizeDependence(cause_key(named), name, share, share / sd)


def _traces(put: Problem, named: NamedCause) -> Iterator[tuple[str, Array]]:
    """Yield what the cause would have added (r,), had its size grown with something, and with what."""
    size = named.effect.told_size(named.theta)
    whole = tuple(named.effect.removed(case, size) for case in put.cases)
    for name, signals in _signals(put).items():
        samples = tuple((part * signal[:, None])[:, :, None] for part, signal in zip(whole, signals, strict=True))
        yield name, put.padded(put.spectrum.rows(samples)[:, :, 0])
    rows = put.spectrum.rows(tuple(part[:, :, None] for part in whole))[:, :, 0]
    for name, pick in _picks(put).items():
        yield name, put.padded(np.where(pick, rows, 0.0))


def _picks(put: Problem) -> dict[str, NDArray[np.bool_]]:
    """Return the rows of the plates, (n, 6) or what broadcasts to it, of every channel, band and trial."""
    names = [case.trial.name for case in put.cases]
    picks = {channel: np.arange(6)[None, :] == c for c, channel in enumerate(CHANNELS)}
    picks |= {_band(b): (put.spectrum.band == b)[:, None] for b in range(len(BANDS))}
    return picks | (
        {name: (put.spectrum.trial == t)[:, None] for t, name in enumerate(names)} if len(names) > 1 else {}
    )


def _lost_to_errors(found: Model, named: NamedCause, over: tuple[str, ...]) -> Array:
    """Return (k,): by how much the score of each trace is too low if the movement makes all that is left of the wrench:
    what the trace of the measured wrench would add; those of signals about their mean lose nothing.
    """
    put, lost = found.problem, np.zeros(len(over))
    share = named.effect.in_proportion(put.cases[0], named.theta)
    if not share.any():
        return lost
    errors, picks = found.in_newtons(found.posterior.y) @ share.T, _picks(put)
    asked = [name in picks for name in over]
    rows = [put.padded(np.where(picks[name], errors, 0.0)) for name in over if name in picks]
    lost[asked] = found.white(np.stack(rows, axis=1)).T @ found.posterior.residual
    return lost


def _band(index: int) -> str:
    return f"{BANDS.edges[index]:g}-{BANDS.edges[index + 1]:g} Hz"


WEIGHTLESS = frozenset((*(_band(b) for b in range(1, len(BANDS))), *CHANNELS[3:]))
"""What a size may hang on that no mean force shows: the moments, and all bands but the slowest."""


def _signals(put: Problem) -> dict[str, list[Array]]:
    """Return per trial (T,) what a size may hang on, about its mean over the frames used: load (of its mean) and place
    (in `_STEP`) as the movement needs them (what was measured reproduces any residual), time of the session and of the
    trial (of the whole).
    """
    needed = [case.predicted for case in put.cases]
    force = [np.where(np.abs(wrench[:, 2]) > 1.0, wrench[:, 2], 1.0) for wrench in needed]
    weight = float(np.mean(np.concatenate(force)))
    raw = {
        "load": [wrench[:, 2] / weight for wrench in needed],
        "place along x": [-wrench[:, 4] / fz / _STEP for wrench, fz in zip(needed, force, strict=True)],
        "place along y": [wrench[:, 3] / fz / _STEP for wrench, fz in zip(needed, force, strict=True)],
        "time of the session": [case.session_time for case in put.cases],
        "time of the trial": [np.linspace(0.0, 1.0, case.motion.time.size) for case in put.cases],
    }
    frames = [np.concatenate((*picks, np.zeros(0, dtype=int))) for picks in put.spectrum.picks]
    mean = {
        name: np.mean(np.concatenate([signal[pick.astype(int)] for signal, pick in zip(one, frames, strict=True)]))
        for name, one in raw.items()
    }
    return {name: [signal - mean[name] for signal in one] for name, one in raw.items()}
