"""Which trials of a session the diagnosis looks at, and the tolerances that hold for the person in them."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from biodance.body.body import Body
from biodance.diagnosis.problem import Look
from biodance.diagnosis.spectrum import SHORTEST_RUN, spectrum, thinned
from biodance.effects import Case
from biodance.identification.statistics import Fit, standing_point
from biodance.pipeline.identification import FITTED_ROLES, KEPT_ROLES
from biodance.pipeline.results import SessionResult
from biodance.pipeline.trial_result import TrialResult
from biodance.records import Array, Role, Trial, runs
from biodance.records.attention import Judged
from biodance.uncertainty.bands import BANDS
from biodance.uncertainty.session_noise import added_noise, of_marker_errors, of_zeros, with_own_noise, with_zeros
from biodance.uncertainty.skin_unrest import excess_unrest, skin_unrest
from biodance.uncertainty.tolerances import Tolerances, shipped


@dataclass(frozen=True, eq=False)
class Own:
    """``tolerances`` that hold for some recordings, ``notes`` on what changed, and whether a name found under them
    is ``believed``.
    """

    tolerances: Tolerances
    notes: tuple[str, ...] = ()
    believed: bool = True


_POSTURES = 4
"""Postures in which the way from marker noise to wrench is computed."""
_ENOUGH = 10.0
"""s of fully measured movement beside which quiet standing tells nothing more."""
MORE = 1.6
"""So many times as large it must be before soft tissue is believed to be larger than theirs (five real walks: 2.4 to
4.8 times).
"""
_TOO_FAR = 4.0
"""So many times as far from the body, markers are no longer those of the segments that they are named after: nothing is
named. (Soft tissue made 2 to 3 times as large in an independent laboratory: 1.6 to 2.6.)
"""
_SOFT = (
    "flesh ",
    "sag ",
    "slide ",
    "tilt ",
    "marker ",
    "joint_centre ",
    "segment_length ",
    "marker_misplaced ",
    "wobbling_mass ",
    "shown ",
)
"""Keys of the tolerances that grow with it."""
TOO_SHORT = f"no {SHORTEST_RUN:g} s in which the plates measure all ground contact without a break."
"""Why a trial with measured contact is not looked at."""
SWAYING = 0.3
"""Hz: above, what a person who stands still does to the plates is heart, breath and muscles, which no marker shows."""
UNREST = 1.5
"""N, N·m RMS per band and channel: no more than this is taken for it (three real persons: up to 0.8 N and 0.7 N·m)."""


def looks(results: tuple[TrialResult, ...], roles: tuple[Role, ...]) -> tuple[Look, ...]:
    """Return the trials of the given roles that have motion and measured contact, each at its place in the session's
    time; static trials belong to that time only where they are asked for.
    """
    moving = [one for one in results if one.motion is not None and (one.trial.role != "static" or "static" in roles)]
    ends = np.cumsum([float(one.motion.time[-1] - one.motion.time[0]) for one in moving if one.motion is not None])
    found = []
    for one, end in zip(moving, ends, strict=True):
        if one.comparison is None or one.motion is None or one.trial.role not in roles or not one.comparison.used.any():
            continue
        start = end - float(one.motion.time[-1] - one.motion.time[0])
        found.append(Look(one.trial, one.motion, one.comparison.used, start / ends[-1], end / ends[-1]))
    return tuple(found)


def looked_at(results: tuple[TrialResult, ...]) -> tuple[Look, ...]:
    """Return the trials to look at: those to fit, else those kept, and quiet standing beside them where they are
    short.
    """
    roles = FITTED_ROLES if looks(results, FITTED_ROLES) else KEPT_ROLES
    moving = looks(results, roles)
    return moving if sum(map(seconds_of, moving)) >= _ENOUGH else looks(results, ("static", *roles))


def all_looks(results: tuple[TrialResult, ...]) -> tuple[Look, ...]:
    """Return the trials that checks look at: those to look at, and those kept."""
    return (*looked_at(results), *looks(results, KEPT_ROLES))


def cases_of(body: Body | None, found: tuple[Look, ...]) -> tuple[Case, ...]:
    """Return the trials as effects see them, at the rate of the markers, with the table's parameters."""
    if body is None:
        return ()
    return tuple(
        Case(body, look.trial, look.motion, body.sip.phi, np.linspace(look.start, look.end, look.motion.time.size))
        for look in found
    )


def left_out(results: tuple[TrialResult, ...]) -> tuple[str, ...]:
    """Say of every trial that is not looked at, though it should be, why."""
    return tuple(
        f"{name} was left out{'. ' if why[:1].isupper() else ': '}{why}" if why else f"{name} was left out."
        for name, why in reasons_left_out(results).items()
    )


def reasons_left_out(results: tuple[TrialResult, ...]) -> dict[str, str]:
    """Return by name why a trial is not looked at, though it should be."""
    roles, why = ("static", *FITTED_ROLES), {}
    seen = {look.trial.name: seconds_of(look) for look in looks(results, roles)}
    for one in results:
        if one.trial.role not in FITTED_ROLES:
            continue
        if one.trial.name not in seen:
            why[one.trial.name] = " ".join(one.reasons)
        elif seen[one.trial.name] == 0:
            why[one.trial.name] = TOO_SHORT
    return why


def seconds_of(look: Look) -> float:
    """Return for how many seconds a trial can be compared, in runs that are long enough."""
    return sum(_runs_of(look))


def _runs_of(look: Look) -> tuple[float, ...]:
    """Return the seconds of every run of a trial that can be compared and is long enough."""
    rate = look.motion.rate
    if not np.isfinite(rate):
        return ()
    return tuple((stop - start) / rate for start, stop in runs(look.use) if stop - start >= SHORTEST_RUN * rate)


def own_tolerances(
    body: Body, chosen: tuple[Look, ...], recorded: tuple[Trial, ...] = (), *, known: Tolerances | None = None
) -> Own:
    """Return the ``known`` tolerances (a laboratory's own; by default the shipped ones) as they hold for these
    recordings: with markers that move more on the body than where they were learned, with the noise of their own
    cameras and plates as ``recorded`` shows it, with the unrest of a person who stands still where standing is looked
    at, and with trial means no surer than a plate's zero.
    """
    found, notes, mass = known or shipped(), [], float(body.sip.mass.sum())
    postures = np.array([look.motion.q[len(look.motion.q) // 2] for look in chosen if look.motion.q.size])[:_POSTURES]
    about = standing_point(tuple(map(_fit, chosen)))
    if recorded and postures.size:
        found = with_own_noise(found, added_noise(body, recorded, postures, about, known=found.instruments), mass)
    factor = soft_tissue(chosen) / found.instruments.distance
    if factor > MORE:
        found = widened_by(found, factor)
        notes.append(
            f"Markers are farther from the body than where tolerances were learned ({factor:.1f} times in the first "
            f"quartile): soft tissue and joints, and what they leave in the forces, were taken for so many times as "
            f"large, and a fault must be larger to be seen. Tolerances learned on sessions of your own laboratory "
            f"without fault (biodance learn) hold for it."
        )
    restless = excess_unrest(skin_of(body, chosen), found.instruments.skin)
    if restless.any():
        found = with_own_noise(found, of_marker_errors(body, postures, about, restless), mass)
    standing = tuple(look for look in chosen if look.trial.role == "static" and seconds_of(look) > 0)
    if standing:
        shaken = unrest(body, standing, about)
        found = with_own_noise(found, shaken, mass)
        size = np.sqrt(np.einsum("b,bcc->c", 2 * np.diff(BANDS.edges) / BANDS.rate, shaken))
        notes.append(
            f"Standing still, the person moves the forces by {size[:3].max():.1f} N and the moments by "
            f"{size[3:].max():.1f} N·m above "
            f"{SWAYING:g} Hz (heart, breath, muscles; root mean square), which no marker shows: a fault must be "
            f"larger to be seen."
        )
    zeros = of_zeros([run for look in chosen for run in _runs_of(look)])
    return Own(with_zeros(found, zeros, mass), tuple(notes), believed=factor <= _TOO_FAR)


def widened_by(known: Tolerances, factor: float) -> Tolerances:
    """Return tolerances for soft tissue and joints ``factor`` times as large: their sizes, and what they leave in the
    wrench beyond them; the mean force is weight, whatever the skin does.
    """
    sizes = {key: size * (factor if key.startswith(_SOFT) else 1.0) for key, size in known.sizes.items()}
    more = np.full((len(known.noise), 6), factor)
    more[0, :3] = 1.0
    return replace(known, sizes=sizes, noise=known.noise * more[:, :, None] * more[:, None, :])


def soft_tissue(chosen: tuple[Look, ...]) -> float:
    """Return the first quartile over markers and moving trials of the RMS distance to the body, m: markers that are
    wrong do not count.
    """
    moving = [look.motion.residual for look in chosen if look.trial.role != "static" and seconds_of(look) > 0]
    with np.errstate(invalid="ignore"):
        each = [np.sqrt(np.nanmean(residual**2, axis=0)) for residual in moving if residual.size]
    return float(np.nanquantile(np.concatenate(each), 0.25)) if each else 0.0


def skin_of(body: Body, chosen: tuple[Look, ...]) -> Array:
    """Return the `skin_unrest` (B, 3) of the trials of people who move."""
    return skin_unrest(body, ((one.trial, one.motion, one.use) for one in chosen if one.trial.role != "static"))


def unrest(body: Body, standing: tuple[Look, ...], about: Array) -> Array:
    """Return (B, 6, 6) covariance of a coefficient of what standing still leaves above `SWAYING`, per band, moments
    about ``about`` (3,) m; zero below.
    """
    cases, uses = zip(*(_thinned(body, look) for look in standing), strict=True)
    where = spectrum(cases, uses, about)
    left = where.rows(tuple(case.residual[:, :, None] for case in cases))[:, :, 0]
    out = np.zeros((len(BANDS), 6, 6))
    for b in np.flatnonzero(np.array(BANDS.edges[:-1]) >= SWAYING):
        here = left[where.band == b]
        size = np.sqrt(np.sum(here**2, axis=0) / (BANDS.rate * where.seconds))
        believed = here * np.minimum(1.0, UNREST / np.maximum(size, 1e-9))
        out[b] = believed.T @ believed / max(1, len(here))
    return out


def _fit(look: Look) -> Fit:
    return Fit(look.trial.name, look.motion, look.trial.wrench, look.use)


def _thinned(body: Body, look: Look) -> tuple[Case, NDArray[np.bool_]]:
    time = np.linspace(look.start, look.end, look.motion.time.size)
    return thinned(Case(body, look.trial, look.motion, body.sip.phi, time), look.use)


_STATIC = "quiet standing tells nothing beside so much movement"


_KEPT = "kept to measure what a finding gains"


_NEVER = "it holds no measured ground contact"


def judged_trials(result: SessionResult, used: tuple[Look, ...]) -> tuple[Judged, ...]:
    """Return for every trial and refused file of a session how many seconds of it are judged in ``used``, or why it
    is not.
    """
    seconds = {look.trial.name: seconds_of(look) for look in used}
    why = reasons_left_out(result.trials)
    kept = {look.trial.role for look in used if seconds[look.trial.name] > 0}
    rows = []
    for one in result.trials:
        name, role = one.trial.name, one.trial.role
        if seconds.get(name, 0.0) > 0:
            rows.append(Judged(name, seconds[name]))
        elif "fit" in kept and role not in ("fit", "static"):
            rows.append(Judged(name, 0.0, _KEPT))
        elif role == "static" and kept:
            rows.append(Judged(name, 0.0, _STATIC))
        else:
            short = TOO_SHORT if one.comparison is not None and one.comparison.used.any() else _NEVER
            rows.append(Judged(name, 0.0, why.get(name) or " ".join(one.reasons) or short, missed=True))
    return (*rows, *(Judged(file, 0.0, reason, missed=True) for file, reason in result.session.refused.items()))


def identified_trials(result: SessionResult) -> tuple[Judged, ...]:
    """Return for every trial to identify from how many measured seconds it holds, or why none."""
    used = set(result.identification.identification.trials) if result.identification else set()
    rows = []
    for one in result.trials:
        if one.trial.role != "fit":
            continue
        here = one.comparison if one.name in used else None
        seconds = float(here.used.sum() * np.median(np.diff(here.time))) if here and here.time.size > 1 else 0.0
        rows.append(Judged(one.name, seconds, "" if seconds else " ".join(one.reasons) or _NEVER, missed=not seconds))
    return tuple(rows)
