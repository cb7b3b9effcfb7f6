"""The cut-off of the low-pass that the movement and the noise of a trial ask for, as its markers tell them.

Winter's residual analysis takes what is fast for noise, and so misses what flesh, labels and stamps do at the
frequencies of the movement. A body of rigid segments misses its markers at every frequency, and that is noise wherever
it stands. With P the power of the markers' coordinates and N that of their noise per frequency f, both per coordinate,
a low-pass of gain H leaves the expected square error

    sum over f of  (1 - H)² (P - N) + H² N,

what it takes from the movement and what it leaves of the noise (Stein's unbiased risk). The cut-off is the least of it.
N is the power of the misfit, times 3 K / (3 K - n) for the n coordinates that K markers placed, plus a white part that
all markers share (stamps that jitter move all of them alike, and no misfit shows it): what markers move more than they
miss the body by in the fastest quarter of the spectrum, where nobody moves.
"""

from dataclasses import replace

import numpy as np
from scipy.fft import dst

from biodance.body.body import Body
from biodance.errors import BiodanceError
from biodance.lab.filters import USUAL_CUTOFF, LowPass, motion_filter
from biodance.motion.ik.inverse_kinematics import solve_ik
from biodance.motion.kinematics import poses
from biodance.motion.track import hold_open
from biodance.records import Array, Markers, Trial

_FASTEST = 0.375
"""Of the rate: from here to half of it lies the fastest quarter of the spectrum."""
_PERIODS = 3
"""Periods of the cut-off that a trial must last: as many continue its ends (`motion.smoothing`)."""
_STEP = 0.1
"""Hz between the cut-offs that are tried."""


def with_own_cutoff(trial: Trial, body: Body, markers: Markers) -> Trial:
    """Return a ``trial`` as read with the cut-off that the prepared ``markers`` ask for, and a sentence on it; as it is
    where a cut-off was set, a static posture is no movement, or the markers do not tell.
    """
    if trial.settings.filter.cutoff != "auto" or trial.role == "static":
        return trial
    try:
        cutoff = own_cutoff(body, markers, motion_filter(trial.settings))
    except BiodanceError:
        return trial  # tracking meets the same markers, and says why
    if cutoff is None:
        return trial
    said = (
        f"Cut-off of the low-pass: {cutoff:g} Hz, where the filtered markers of this trial lie nearest to the path of "
        "rigid segments."
    )
    settings = trial.settings.changed({"filter.cutoff": cutoff})
    return replace(trial, settings=settings, history=(*trial.history, said))


def own_cutoff(body: Body, markers: Markers, settings: LowPass) -> float | None:
    """Return the cut-off (Hz) of a low-pass of the kind and order of ``settings`` at which ``markers`` that ``body``
    follows are expected to err least; None where they are too few or too short to tell.

    No more than the usual 10 Hz: residuals are judged at 25 samples a second, which faster ones would upset.

    Raises
    ------
    TrialRefused
        The markers do not determine the posture.
    """
    rate = markers.rate if markers.time.size > 1 else 0.0
    low, high = max(1.0, _PERIODS * rate / max(markers.time.size, 1)), min(USUAL_CUTOFF, _FASTEST * rate)
    if low >= high:
        return None
    followed, _ = hold_open(body, markers)
    model = poses(followed, solve_ik(followed, markers).q)
    worn = [k for k, name in enumerate(body.markers.names) if name in markers]
    unseen = np.array([np.isnan(markers[body.markers.names[k]]).any(axis=1).sum() for k in worn])
    columns = [k for k, count in zip(worn, unseen, strict=True) if count <= np.median(unseen)]
    placed = followed.n_root + int(followed.free.sum())
    if 3 * len(columns) <= placed:
        return None
    path = markers.select(body.markers.names[k] for k in columns).xyz
    points = model.points([body.markers.segment[k] for k in columns], body.markers.position[columns])
    power, missed = _power(path), _power(path - points) * 3 * len(columns) / (3 * len(columns) - placed)
    frequency = np.arange(1, power.size + 1) * rate / (2 * (power.size + 1))
    fast = frequency > _FASTEST * rate
    noise = missed + max(0.0, float((power - missed)[fast].mean()))
    tried = np.arange(np.ceil(low / _STEP), np.floor(high / _STEP) + 1) * _STEP
    gains = (replace(settings, cutoff=float(cutoff)).gain(frequency, rate) for cutoff in tried)
    error = [float(np.sum((1 - gain) ** 2 * power + (2 * gain - 1) * noise)) for gain in gains]
    return round(float(tried[int(np.argmin(error))]), 1)


def _power(values: Array) -> Array:
    """Return the mean power (T - 2,) of columns (T, ...) per frequency: of the sine transform of what is beside the
    straight line between the ends, which continues them by point reflection as the low-pass does. Straight, too, over
    what is NaN.
    """
    columns, frames = np.array(values).reshape(len(values), -1), np.arange(len(values))
    for column in columns.T:
        known = np.isfinite(column)
        column[~known] = np.interp(frames[~known], frames[known], column[known])
    share = np.linspace(0.0, 1.0, len(columns))[:, None]
    beside = columns - (1 - share) * columns[:1] - share * columns[-1:]
    return np.asarray(np.mean(dst(beside[1:-1], type=1, axis=0, norm="ortho") ** 2, axis=1))
