"""Make a trial ready for the model: the set's markers, frozen frames and spikes taken out, gaps dealt with, and every
plate filtered and sampled at marker times.

The markers are NOT low-passed: the joint coordinates are, later and with the same filter, so that motion and forces
pass it exactly once.
"""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from biodance.errors import BiodanceError, TrialRefused
from biodance.lab.markers.sets import canonical, read_marker_set
from biodance.lab.markers.signals import BRIDGED, faulty_markers, fill_gaps, report_gaps, without_faults
from biodance.lab.markers.time_axis import of_postures
from biodance.records import Array, Markers, Plate, Trial, Wrench, contact_times, runs
from biodance.settings import FilterKind, FilterSettings, GapSettings, Settings

USUAL_CUTOFF = 10.0
"""Hz: the cut-off until a trial's own is known, and the highest that is chosen for one."""


@dataclass(frozen=True)
class LowPass:
    """Low-pass of a ``kind``: ``order`` of one of two passes, ``cutoff`` Hz where both are 3 dB down."""

    order: int = FilterSettings.order
    cutoff: float = USUAL_CUTOFF
    kind: FilterKind = FilterSettings.kind

    def __post_init__(self) -> None:
        if not 1 <= self.order <= 10:
            raise BiodanceError(f"The low-pass has the order {self.order}; legal is 1 to 10. Use 5.")
        if not (np.isfinite(self.cutoff) and self.cutoff > 0):
            raise BiodanceError(f"The low-pass has the cut-off {self.cutoff} Hz; it must be positive. Use 10 Hz.")

    def __str__(self) -> str:
        down = f"3 dB down at {self.cutoff:g} Hz in both passes together"
        name = "Butterworth" if self.kind == "butterworth" else "critically damped"
        return f"{name} low-pass of order {self.order}, forwards and backwards, {down}"

    def gain(self, frequency: Array, rate: float) -> Array:
        """Return the gain (n,) of both passes together at each ``frequency`` (n,) Hz below half the ``rate`` Hz."""
        # tan: the bilinear transform maps analog frequencies so.
        relative = np.tan(np.pi * np.asarray(frequency) / rate) / self._raised(rate)
        if self.kind == "critically_damped":
            # Each of n first-order sections has 1 / sqrt(1 + r²), run twice.
            return np.asarray((1 + relative**2) ** -float(self.order))
        return np.asarray(1 / (1 + relative ** (2 * self.order)))

    def _raised(self, rate: float) -> float:
        """Return tan(pi f / rate) of the frequency f that one pass is designed for."""
        wanted = float(np.tan(np.pi * self.cutoff / rate))
        if self.kind == "critically_damped":
            # (1 + r²)^-n = 1 / sqrt(2).
            return wanted / float(np.sqrt(2 ** (0.5 / self.order) - 1))
        # both passes: 1 / (1 + r^(2 n)) = 1 / sqrt(2) at the wanted frequency, r relative to the designed one
        return wanted * float((np.sqrt(2) - 1) ** (-0.5 / self.order))

    def shortest(self, rate: float) -> int:
        """Return the shortest run of samples that is filtered: one period of the cut-off frequency."""
        return int(np.ceil(rate / self.cutoff)) + 1


def motion_filter(settings: Settings) -> LowPass:
    """Return the low-pass of the joint coordinates: with the chosen cut-off, else the usual one."""
    chosen = settings.filter.cutoff
    return LowPass(settings.filter.order, USUAL_CUTOFF if chosen == "auto" else float(chosen), settings.filter.kind)


def force_filter(settings: Settings) -> LowPass:
    """Return the low-pass of the forces: that of the joint coordinates, unless another cut-off was chosen."""
    chosen, same = settings.filter.force_cutoff, motion_filter(settings)
    return same if chosen == "same" else replace(same, cutoff=float(chosen))


def highest_frequency(settings: Settings) -> float:
    """Return the Hz above which the low-pass of the movement or of the forces leaves nothing to compare."""
    return min(motion_filter(settings).cutoff, force_filter(settings).cutoff)


@lru_cache(maxsize=32)
def _design_low_pass(settings: LowPass, rate: float) -> Array:
    """Return the second-order sections (S, 6) of one of the two passes at the sampling ``rate`` in Hz."""
    if not (np.isfinite(rate) and rate > 0):
        raise BiodanceError(f"The sampling rate is {rate} Hz, which must be positive. Correct the rate in the file.")
    if settings.cutoff >= rate / 2:
        raise BiodanceError(
            f"The cut-off {settings.cutoff:g} Hz is not below half the sampling rate ({rate:g} Hz). Choose a cut-off "
            f"below {rate / 2:g} Hz."
        )
    from scipy.signal import butter

    designed = np.arctan(settings._raised(rate)) * rate / np.pi
    if settings.kind == "critically_damped":
        # The same first-order section, once for each order: no overshoot.
        return np.tile(butter(1, designed, fs=rate, output="sos"), (settings.order, 1))
    return butter(settings.order, designed, fs=rate, output="sos")


def low_pass(values: Array, rate: float, settings: LowPass) -> Array:
    """Return ``values`` (T, ...) low-passed along time without delay; NaN stay NaN.

    ``rate`` in Hz. Every column is filtered from gap to gap, never across one; a run shorter than
    ``settings.shortest(rate)`` samples is returned as it is (``left_raw`` tells which). The ends are continued by point
    reflection over one period of the cut-off.

    Raises
    ------
    BiodanceError
        The rate or the cut-off is not legal, or the whole signal is shorter than the shortest run.
    """
    from scipy.signal import sosfiltfilt

    sections = _design_low_pass(settings, rate)
    values = np.asarray(values, dtype=float)
    need = settings.shortest(rate)
    if values.shape[0] < need:
        raise BiodanceError(
            f"{values.shape[0]} samples at {rate:g} Hz are too short for a low-pass at {settings.cutoff:g} Hz: at "
            f"least {need} are needed. Record longer or leave the signal as it is."
        )
    columns = values.reshape(values.shape[0], -1)
    whole = ~np.isnan(columns).any(axis=0)
    if whole.all():
        # Padding of one period, reflected about the end points.
        return np.asarray(sosfiltfilt(sections, columns, axis=0, padlen=need - 1)).reshape(values.shape)
    out = columns.copy()
    if whole.any():
        out[:, whole] = sosfiltfilt(sections, columns[:, whole], axis=0, padlen=need - 1)
    for column in np.flatnonzero(~whole):
        for start, stop in runs(~np.isnan(columns[:, column])):
            if stop - start >= need:
                out[start:stop, column] = sosfiltfilt(sections, columns[start:stop, column], padlen=need - 1)
    return out.reshape(values.shape)


def left_raw(values: Array, rate: float, settings: LowPass) -> NDArray[np.bool_]:
    """Return where ``low_pass`` leaves a number as it is: its run is too short; shape of ``values``."""
    columns = np.asarray(values, dtype=float).reshape(len(values), -1)
    out = np.zeros(columns.shape, dtype=bool)
    for column in np.flatnonzero(np.isnan(columns).any(axis=0)):
        for start, stop in runs(~np.isnan(columns[:, column])):
            out[start:stop, column] = stop - start < settings.shortest(rate)
    return out.reshape(np.shape(values))


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
    filtering = force_filter(trial.settings)
    history, warnings = [_PREPARED], []
    markers = trial.markers
    try:
        if markers is not None:
            if markers.time.size > 1 and not of_postures(markers.time):
                _design_low_pass(filtering, markers.rate)
            markers, said = _common_time(markers, trial)
            history += said
            markers, said, warned = _fill(markers, trial.marker_set, trial.settings.gaps)
            history, warnings = history + said, warned
        plates = tuple(
            replace(at_marker_times(plate, markers, filtering), peaks=_with_peaks(plate.wrench, markers))
            for plate in trial.plates
        )
    except TrialRefused:
        raise
    except BiodanceError as error:
        raise TrialRefused(f"Trial {trial.name}: {error}") from error
    done = {plate.decisions[-1]: [p.name for p in plates if p.decisions[-1] == plate.decisions[-1]] for plate in plates}
    history += [f"{', '.join(same)}: {how}" for how, same in done.items()]
    return replace(
        trial, markers=markers, plates=plates, history=(*trial.history, *history), warnings=(*trial.warnings, *warnings)
    )


def _common_time(markers: Markers, trial: Trial) -> tuple[Markers, list[str]]:
    """Return the markers within the time of all plates (one analog sample of tolerance), and what was cut off."""
    times = [plate.wrench.time for plate in trial.plates if plate.wrench.time.size]
    if not times:
        return markers, []
    # The coarser of the clocks: one sample of tolerance at both ends.
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
    # one sentence for all bridged gaps and one for every other gap
    time, bridged = markers.time, [gap.label for gap in gaps if gap.how is BRIDGED]
    said = [f"Short gaps bridged by a spline ({len(bridged)}): {', '.join(sorted(set(bridged)))}."] * bool(bridged)
    for gap in gaps:
        if gap.how is not BRIDGED:
            said.append(f"{gap.label} {time[gap.start]:.2f} to {time[gap.stop - 1]:.2f} s {gap.how}.")
    return filled, [*history, *(said or ["No marker has a gap."])], warnings


def at_marker_times(plate: Plate, markers: Markers | None, filtering: LowPass) -> Plate:
    """Return the plate with its wrench filtered and at marker times; the last decision says how."""
    wrench = plate.wrench
    plate = replace(plate, loaded=contact_times(wrench))
    if of_postures(wrench.time):
        how = "not filtered, every row is a posture"
    elif wrench.time.size < 2 or wrench.time.size < filtering.shortest(wrench.rate):
        mean = np.broadcast_to(wrench.value.mean(axis=0), wrench.value.shape)
        wrench, how = Wrench(wrench.time, mean), f"mean of {wrench.time.size} samples, too few for the low-pass"
    else:
        raw = left_raw(wrench.value, wrench.rate, filtering).any(axis=1).sum()
        wrench = Wrench(wrench.time, low_pass(wrench.value, wrench.rate, filtering))
        how = f"{filtering}" + (f"; {raw} samples between gaps left unfiltered" if raw else "")
    if markers is None:
        return replace(plate, wrench=wrench, decisions=(*plate.decisions, f"{how}; no markers, own times kept."))
    value, sampled = _sample(wrench, markers.time)
    return replace(plate, wrench=Wrench(markers.time, value), decisions=(*plate.decisions, f"{how}; {sampled}."))


def _with_peaks(wrench: Wrench, markers: Markers | None) -> Wrench | None:
    """Return the wrench at marker times, low-passed as little as their rate allows; None where they have no rate."""
    if markers is None or markers.time.size < 2 or of_postures(markers.time) or of_postures(wrench.time):
        return None
    # 0.4 of the rate: a little below its half, beyond which frequencies fold
    mild = LowPass(cutoff=0.4 * min(markers.rate, wrench.rate))
    if wrench.time.size >= mild.shortest(wrench.rate):
        wrench = Wrench(wrench.time, low_pass(wrench.value, wrench.rate, mild))
    return Wrench(markers.time, _sample(wrench, markers.time)[0])


def _sample(wrench: Wrench, time: Array) -> tuple[Array, str]:
    """Return the wrench (T, 6) at marker times, by a cubic spline where no samples lie there; how it was found."""
    after = np.clip(np.searchsorted(wrench.time, time), 0, wrench.time.size - 1)
    before = np.maximum(after - 1, 0)
    # The nearer of the two samples around each frame.
    nearest = np.where(time - wrench.time[before] < wrench.time[after] - time, before, after)
    if wrench.time.size == 1 or np.allclose(wrench.time[nearest], time, rtol=0, atol=1e-6):
        return wrench.value[nearest], "sampled at the marker frames"
    from scipy.interpolate import make_interp_spline

    known = np.logical_not(np.isnan(wrench.value).any(axis=1))
    if known.sum() < 2:
        return np.full((time.size, 6), np.nan), "nothing known at the marker frames"
    spline = make_interp_spline(wrench.time[known], wrench.value[known], k=min(3, int(known.sum()) - 1))
    # Outside the record nothing is extrapolated: the end values.
    value = spline(np.clip(time, wrench.time[0], wrench.time[-1]))
    value[~(known[before] & known[after])] = np.nan
    return value, "interpolated at the marker frames"
