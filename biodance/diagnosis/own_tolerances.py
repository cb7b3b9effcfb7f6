"""The tolerances that hold for some recordings: the learned ones, with what these recordings show of their own skin,
cameras, plates and quiet standing.
"""

from dataclasses import dataclass, replace

import numpy as np

from biodance import display
from biodance.body.body import Body
from biodance.diagnosis.problem import TrialWindow
from biodance.diagnosis.spectrum import Spectrum, needed, spectrum, thinned
from biodance.effects import Case
from biodance.identification.statistics import standing_point
from biodance.records import Array, Trial
from biodance.uncertainty.bands import BANDS
from biodance.uncertainty.session_noise import (
    SkinUnrest,
    added_noise,
    of_marker_errors,
    of_unseen_joints,
    of_zeros,
    skin_unrest,
    with_movement,
    with_own_noise,
    with_zeros,
)
from biodance.uncertainty.tolerances import Tolerances, shipped

_POSTURES = 4
"""Postures in which the way from marker noise to wrench is computed."""
MORE = 1.6
"""So many times as large it must be before soft tissue is believed to be larger than theirs (five real walks: 2.4 to
4.8 times).
"""
_TOO_FAR = 4.0
"""So many times as far from the body, markers are no longer those of the segments that they are named after: nothing is
named. (Soft tissue made 2 to 3 times as large in an independent laboratory: 1.6 to 2.6.)
"""
_SOFT = ("flesh ", "sag ", "slide ", "marker ", "wobbling_mass ", "shown ")
"""Keys of the tolerances that grow with it: bones and where markers are stuck do not."""
SWAYING = 0.3
"""Hz: above, what a person who stands still does to the plates is heart, breath and muscles, which no marker shows."""
UNREST = 1.5
"""N, N·m RMS per band and channel: no more than this is taken for it (three real persons: up to 0.8 N and 0.7 N·m)."""


@dataclass(frozen=True, eq=False)
class SessionTolerances:
    """``tolerances`` that hold for some recordings, ``notes`` on what changed, and whether a name found under them
    is ``believed``.
    """

    tolerances: Tolerances
    notes: tuple[str, ...] = ()
    believed: bool = True


def own_tolerances(
    body: Body, chosen: tuple[TrialWindow, ...], recorded: tuple[Trial, ...] = (), *, known: Tolerances | None = None
) -> SessionTolerances:
    """Return the ``known`` tolerances (a laboratory's own; by default the shipped ones) as they hold for these
    recordings: with markers that move more on the body than where they were learned, with the noise of their own
    cameras and plates as ``recorded`` shows it, with that of a movement that needs more force, with joints that move
    and no marker shows, with the unrest of a person who stands still where standing is looked at, and with trial means
    no surer than a plate's zero.
    """
    found, notes, mass = known or shipped(), [], float(body.sip.mass.sum())
    middle = [window.motion.q[len(window.motion.q) // 2] for window in chosen if window.motion.q.size]
    postures = np.array(middle[:_POSTURES])
    about = standing_point(tuple(window.fit for window in chosen))
    if recorded and postures.size:
        found = with_own_noise(found, added_noise(body, recorded, postures, about, known=found.instruments), mass)
    moving, standing = (
        tuple(one for one in chosen if one.seconds > 0 and (one.trial.role == "static") == still)
        for still in (False, True)
    )
    if moving:
        found = with_movement(found, needed(*_looked_at(body, moving, about)))
    factor = soft_tissue(chosen) / found.instruments.distance
    if factor > MORE:
        found = widened_by(found, factor)
        notes.append(
            f"Markers are farther from the body than where tolerances were learned ({factor:.1f} times, for the "
            f"quarter of them that follows best): soft tissue, and what it leaves in the forces, was taken for so "
            f"many times as large, and a fault must be larger to be seen. Tolerances learned on sessions of your own "
            f"laboratory without fault (biodance learn) hold for it."
        )
    if moving and not body.free.all():
        found = with_own_noise(found, of_unseen_joints(body, postures, about), mass)
        notes.append(_unseen_note(body))
    restless = skin_of(body, chosen).excess(found.instruments.skin, found.instruments.swing)
    if restless.any():
        found = with_own_noise(found, of_marker_errors(body, postures, about, restless), mass)
    if standing:
        shaken = unrest(body, standing, about)
        found = with_own_noise(found, shaken, mass)
        notes.append(_unrest_note(shaken))
    zeros = of_zeros([run for window in chosen for run in window.runs])
    return SessionTolerances(with_zeros(found, zeros, mass), tuple(notes), believed=factor <= _TOO_FAR)


def _looked_at(body: Body, windows: tuple[TrialWindow, ...], about: Array) -> tuple[tuple[Case, ...], Spectrum]:
    """Return trials at the rate at which they are looked at, and where their rows come from."""
    cases, uses = zip(*(thinned(one.case(body, body.sip.phi), one.use) for one in windows), strict=True)
    return cases, spectrum(cases, uses, about)


def _unseen_note(body: Body) -> str:
    """Say what joints no marker shows."""
    hidden = (joint.name for joint, free in zip(body.joints, body.free, strict=True) if not free)
    names = ", ".join(dict.fromkeys(display.spaced(name.rsplit("_", 1)[0]) for name in hidden))
    return (
        f"No marker shows what moves at {names}, and the plates measure it: as much as people move there who walk "
        f"is taken for theirs, and a fault must be larger to be seen."
    )


def _unrest_note(shaken: Array) -> str:
    """Say how large an unrest of covariance ``shaken`` (B, 6, 6) per coefficient is."""
    # A band of width w holds 2 w / rate of all coefficients: so much of each variance adds to the mean square.
    size = np.sqrt(np.einsum("b,bcc->c", 2 * np.diff(BANDS.edges) / BANDS.rate, shaken))
    return (
        f"Standing still, the person moves the forces by {size[:3].max():.1f} N and the moments by "
        f"{size[3:].max():.1f} N·m above {SWAYING:g} Hz (heart, breath, muscles; root mean square), which no "
        f"marker shows: a fault must be larger to be seen."
    )


def widened_by(known: Tolerances, factor: float) -> Tolerances:
    """Return tolerances for soft tissue ``factor`` times as large: its sizes, and what it leaves in the wrench beyond
    them; the mean force is weight, whatever the skin does.
    """
    sizes = {key: size * (factor if key.startswith(_SOFT) else 1.0) for key, size in known.sizes.items()}
    more = np.full((len(known.noise), 6), factor)
    more[0, :3] = 1.0
    # D N D with D = diag(more): correlations stay.
    return replace(known, sizes=sizes, noise=known.noise * more[:, :, None] * more[:, None, :])


def soft_tissue(chosen: tuple[TrialWindow, ...]) -> float:
    """Return the first quartile over markers and moving trials of the RMS distance to the body, m: markers that are
    wrong do not count.
    """
    moving = [window.motion.residual for window in chosen if window.trial.role != "static" and window.seconds > 0]
    with np.errstate(invalid="ignore"):
        each = [np.sqrt(np.nanmean(residual**2, axis=0)) for residual in moving if residual.size]
    return float(np.nanquantile(np.concatenate(each), 0.25)) if each else 0.0


def skin_of(body: Body, chosen: tuple[TrialWindow, ...]) -> SkinUnrest:
    """Return the `skin_unrest` of the trials of people who move."""
    return skin_unrest(body, ((one.trial, one.motion, one.use) for one in chosen if one.trial.role != "static"))


def unrest(body: Body, standing: tuple[TrialWindow, ...], about: Array) -> Array:
    """Return (B, 6, 6) covariance of a coefficient of what standing still leaves above `SWAYING`, per band, moments
    about ``about`` (3,) m; zero below.
    """
    cases, where = _looked_at(body, standing, about)
    left = where.rows(tuple(case.residual[:, :, None] for case in cases))[:, :, 0]
    out = np.zeros((len(BANDS), 6, 6))
    for b in np.flatnonzero(np.array(BANDS.edges[:-1]) >= SWAYING):
        here = left[where.band == b]
        # Parseval: over the number of samples.
        size = np.sqrt(np.sum(here**2, axis=0) / (BANDS.rate * where.seconds))
        # What is larger is scaled down to `UNREST`.
        believed = here * np.minimum(1.0, UNREST / np.maximum(size, 1e-9))
        out[b] = believed.T @ believed / max(1, len(here))
    return out
