"""Make a trial ready for the model: the set's markers, frozen frames and spikes taken out, gaps dealt with, and every
plate filtered and sampled at marker times.

The markers are NOT low-passed: the joint coordinates are, later and with the same filter, so that motion and forces
pass it exactly once.
"""

from dataclasses import replace

import numpy as np

from biodance.errors import BiodanceError, TrialRefused
from biodance.lab import filters
from biodance.lab.filters import LowPass, force_filter
from biodance.lab.markers.gaps import Gap, fill_gaps, report_gaps
from biodance.lab.markers.sets import canonical, read_marker_set
from biodance.lab.markers.signals import faulty_markers, without_faults
from biodance.lab.markers.time_axis import LONGEST_STEP
from biodance.records import Array, Markers, Plate, Trial, Wrench
from biodance.settings import GapSettings

_PREPARED = "Prepared for the model."


def prepare(trial: Trial) -> Trial:
    """Return the trial with only its set's markers, gaps filled where that is safe, and the plates' wrenches at marker
    times.

    ``trial.settings`` say how forces are filtered and up to which length gaps are bridged by a spline. Without markers
    the plates keep their own times; markers outside the plates' time are cut off. Every step is a sentence in
    ``history``. A trial that was prepared already is returned as it is.

    Raises
    ------
    TrialRefused
        The cut-off is not below half the marker or analog rate, or markers and plates share no time.
    """
    if _PREPARED in trial.history:
        return trial
    low_pass = force_filter(trial.settings)
    history, warnings = [_PREPARED], []
    markers = trial.markers
    try:
        if markers is not None:
            if markers.time.size > 1 and not _postures(markers.time):
                filters.design_low_pass(low_pass, markers.rate)
            markers, said = _common_time(markers, trial)
            history += said
            markers, said, warned = _fill(markers, trial.marker_set, trial.settings.gaps)
            history, warnings = history + said, warned
        plates = tuple(at_marker_times(plate, markers, low_pass) for plate in trial.plates)
    except TrialRefused:
        raise
    except BiodanceError as error:
        raise TrialRefused(f"Trial {trial.name}: {error}") from error
    done = {plate.decisions[-1]: [p.name for p in plates if p.decisions[-1] == plate.decisions[-1]] for plate in plates}
    history += [f"{', '.join(same)}: {how}" for how, same in done.items()]
    return replace(
        trial, markers=markers, plates=plates, history=(*trial.history, *history), warnings=(*trial.warnings, *warnings)
    )


def _postures(time: Array) -> bool:
    """Return whether frames lie too far apart to tell a movement between them: there is nothing to filter."""
    return time.size > 1 and float(np.median(np.diff(time))) > LONGEST_STEP


def _common_time(markers: Markers, trial: Trial) -> tuple[Markers, list[str]]:
    """Return the markers within the time of all plates (one analog sample of tolerance), and what was cut off."""
    times = [plate.wrench.time for plate in trial.plates if plate.wrench.time.size]
    if not times:
        return markers, []
    step = max((float(np.median(np.diff(time))) for time in times if time.size > 1), default=0.0)
    first, last = max(time[0] for time in times) - step, min(time[-1] for time in times) + step
    inside = (markers.time >= first - 1e-9) & (markers.time <= last + 1e-9)
    if inside.all():
        return markers, []
    if not inside.any():
        raise TrialRefused(
            f"Trial {trial.name}: the markers ({markers.time[0]:g} to {markers.time[-1]:g} s) and the plates "
            f"({first:g} to {last:g} s) share no time. Synchronise the files."
        )
    kept = Markers(markers.names, markers.time[inside], markers.xyz[inside])
    return kept, [
        f"{int((~inside).sum())} of {inside.size} frames were cut off: the plates recorded only {first:.3f} to "
        f"{last:.3f} s."
    ]


def _fill(markers: Markers, set_name: str, rules: GapSettings) -> tuple[Markers, list[str], list[str]]:
    """Return the set's markers with filled gaps, the history and the warnings."""
    history, segments = [], {}
    if set_name:
        marker_set = read_marker_set(set_name)
        segments = {marker.label: marker.segment for marker in marker_set.markers}
        others = len(markers.names)
        markers = canonical(markers, marker_set)
        others -= len(markers.names)
        history.append(
            f"{len(markers.names)} markers of the set {marker_set.title} kept, {others} other points left out."
        )
    warnings = [
        f"{gaps.label} was not seen in {gaps.percent:.0f} % of the frames (longest gap {gaps.longest:.2f} s)."
        for gaps in report_gaps(markers)
        if gaps.percent > rules.often
    ]
    faults = faulty_markers(markers)
    history += [one.sentence(one.when(markers.time)) for one in faults]
    filled, gaps = fill_gaps(without_faults(markers, faults), segments, short=rules.bridged)
    return filled, [*history, *_sentences(gaps, markers.time)], warnings


def _sentences(gaps: tuple[Gap, ...], time: Array) -> list[str]:
    """Return one sentence for all bridged gaps and one for every other gap."""
    bridged = sorted({gap.label for gap in gaps if gap.how.startswith("bridged")})
    count = sum(gap.how.startswith("bridged") for gap in gaps)
    said = [f"Short gaps bridged by a spline ({count}): {', '.join(bridged)}."] if bridged else []
    others = [gap for gap in gaps if not gap.how.startswith("bridged")]
    said += [f"{gap.label} {time[gap.start]:.2f} to {time[gap.stop - 1]:.2f} s {gap.how}." for gap in others]
    return said or ["No marker has a gap."]


def at_marker_times(plate: Plate, markers: Markers | None, low_pass: LowPass) -> Plate:
    """Return the plate with its wrench filtered and at marker times; the last decision says how."""
    wrench = plate.wrench
    if _postures(wrench.time):
        how = "not filtered, every row is a posture"
    elif wrench.time.size < 2 or wrench.time.size < low_pass.shortest(wrench.rate):
        mean = np.broadcast_to(wrench.value.mean(axis=0), wrench.value.shape)
        wrench, how = Wrench(wrench.time, mean), f"mean of {wrench.time.size} samples, too few for the low-pass"
    else:
        raw = filters.left_raw(wrench.value, wrench.rate, low_pass).any(axis=1).sum()
        wrench = Wrench(wrench.time, filters.low_pass(wrench.value, wrench.rate, low_pass))
        how = f"{low_pass}" + (f"; {raw} samples between gaps left unfiltered" if raw else "")
    if markers is None:
        return replace(plate, wrench=wrench, decisions=(*plate.decisions, f"{how}; no markers, own times kept."))
    value, sampled = _sample(wrench, markers.time)
    return replace(plate, wrench=Wrench(markers.time, value), decisions=(*plate.decisions, f"{how}; {sampled}."))


def _sample(wrench: Wrench, time: Array) -> tuple[Array, str]:
    """Return the wrench (T, 6) at marker times, by a cubic spline where no samples lie there; how it was found."""
    after = np.clip(np.searchsorted(wrench.time, time), 0, wrench.time.size - 1)
    before = np.maximum(after - 1, 0)
    nearest = np.where(time - wrench.time[before] < wrench.time[after] - time, before, after)
    if wrench.time.size == 1 or np.allclose(wrench.time[nearest], time, rtol=0, atol=1e-6):
        return wrench.value[nearest], "sampled at the marker frames"
    from scipy.interpolate import make_interp_spline

    known = np.logical_not(np.isnan(wrench.value).any(axis=1))
    if known.sum() < 2:
        return np.full((time.size, 6), np.nan), "nothing known at the marker frames"
    spline = make_interp_spline(wrench.time[known], wrench.value[known], k=min(3, int(known.sum()) - 1))
    value = spline(np.clip(time, wrench.time[0], wrench.time[-1]))
    value[~(known[before] & known[after])] = np.nan
    return value, "interpolated at the marker frames"
