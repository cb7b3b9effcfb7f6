"""Sufficient statistics of a session: all that any noise, prior or programme needs from the data, in constant memory;
and the noise that is learned from them, together with the parameters.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, maximum_filter1d

from biodance.body.body import Body
from biodance.errors import BiodanceError, TrialRefused
from biodance.identification.posterior import Information, mean_and_covariance
from biodance.motion.dynamics import predict_wrench, regressor_of
from biodance.motion.kinematics import segment_motion
from biodance.records import Array, Motion, Sip, Wrench
from biodance.settings import Settings
from biodance.spatial import wrench_about_point
from biodance.threads import one_thread
from biodance.uncertainty.bands import Noise
from biodance.uncertainty.learning import Moments, maximise, noise_of

_STILL, POSTURE_BANDS = 0.03, 2
"""A run whose segments all stay within this RMS displacement (m) is standing: soft tissue and marker noise are as large
as its sway, and regressors that are themselves wrong pull masses towards smaller sway. Its posture tells of CoM, so
that only the slowest bands count.
"""


@dataclass(frozen=True, eq=False)
class Fit:
    """One trial to identify from: ``motion`` and ``wrench`` (about the lab origin) at the same times, ``use`` (T,) True
    where both hold; ``cutoff`` Hz of their low-pass, above which nothing is left of either; ``outlier`` the share of
    the load by which a frame may differ from the table's prediction (`Settings.outlier`, `believable`); ``doubts`` (T,
    6, n) N, N·m about the lab origin: what one standard deviation of each of n corrections makes of the wrench, the
    same n in all trials of a session.
    """

    name: str
    motion: Motion
    wrench: Wrench
    use: NDArray[np.bool_]
    outlier: float = Settings.outlier
    doubts: Array = field(default_factory=lambda: np.zeros((0, 6, 0)))
    cutoff: float = np.inf

    def __post_init__(self) -> None:
        frames = self.motion.time.size
        if self.wrench.time.size != frames or self.use.shape != (frames,):
            raise TrialRefused(
                f"Trial {self.name}: motion has {frames} frames, wrench {self.wrench.time.size}, mask "
                f"{self.use.size}; prepare it first."
            )
        if np.isnan(self.wrench.value[self.use]).any():
            raise TrialRefused(f"Trial {self.name}: the wrench is NaN in a frame that is to be used; mask the frame.")


PAIRS = np.triu_indices(6)
"""Pairs of channels, each once: first and second (21,)."""
_OWN = PAIRS[0] == PAIRS[1]


@dataclass(frozen=True, eq=False)
class Statistics:
    """``gram`` (B, 21, p + 1, p + 1) second moments of [W y] per band and pair of channels (`PAIRS`), wrench about
    ``layout.about``; ``count`` (B,) coefficients.

    ``layout`` carries bands, rate and point; its covariance is the identity (nothing is whitened yet).
    """

    gram: Array
    count: NDArray[np.intp]
    layout: Noise

    def __add__(self, other: "Statistics") -> "Statistics":
        """Return the statistics of both; they must have the same layout."""
        if self.layout.bands.edges != other.layout.bands.edges or not np.array_equal(
            self.layout.about, other.layout.about
        ):
            raise BiodanceError(
                "Statistics with different bands or points cannot be added; use one layout for all trials of a session."
            )
        return Statistics(self.gram + other.gram, self.count + other.count, self.layout)

    def add(self, rows: Array, rate: float, cutoff: float = np.inf, bands: int | None = None) -> None:
        """Add the second moments of ``rows`` (T, 6, p + 1) of [W y] at ``rate`` Hz, low-passed at ``cutoff`` Hz, in the
        first ``bands``, by default all, to the arrays.
        """
        X = self.layout.bands.coefficients(self.layout.shift @ rows)
        band = self.layout.bands.at(rate).below(cutoff).of(len(X))
        counts = (band >= 0) & (band < (len(self.gram) if bands is None else bands))
        self.add_coefficients(X[counts], band[counts])

    def add_coefficients(self, X: Array, band: NDArray[np.intp]) -> None:
        """Add the second moments of coefficients ``X`` (m, 6, p + 1) about the layout's point, ``band`` (m,) of each,
        to the arrays.
        """
        size = self.gram.shape[-1]
        for b in np.unique(band):
            flat = X[band == b].reshape(-1, 6 * size)
            # (6, s, 6, s) to [channel, channel, s, s]; only one of each pair is kept.
            self.gram[b] += (flat.T @ flat).reshape(6, size, 6, size).swapaxes(1, 2)[PAIRS]
            self.count[b] += len(flat)

    def slower(self) -> "Statistics":
        """Return the statistics without their fastest band."""
        bands = replace(self.layout.bands, edges=self.layout.bands.edges[:-1])
        return Statistics(self.gram[:-1], self.count[:-1], Noise.unit(self.layout.about, bands))

    def normal_matrix(self, noise: Noise) -> Array:
        """Return the sum over bands of X' S^-1 X (p + 1, p + 1), X = [W y], S the covariance of ``noise`` (same
        bands).
        """
        weight = np.linalg.inv(noise.covariance)
        # sum over pairs of (S^-1)_cd G_cd; pair (d, c) is the transpose: half + half', equal
        # channels counted half before.
        half = np.tensordot(weight[:, *PAIRS] * np.where(_OWN, 0.5, 1.0), self.gram, axes=2)
        return np.asarray(half + half.T)

    def information(self, noise: Noise) -> Information:
        """Return the R factor of the data whitened by ``noise`` (same bands)."""
        return Information.of_normal(self.normal_matrix(noise), int(self.count.sum()))

    def moments(self, phi: Array, covariance: Array) -> Moments:
        """Return the summed squares of y - W phi per band, plus what the ``covariance`` (p, p) of phi adds
        (expectation step).
        """
        # r = X (-phi, 1), so r_c r_d = tr(G_cd z z'); with the covariance of phi: E of it.
        z = np.append(-phi, 1.0)
        second = np.outer(z, z)
        second[:-1, :-1] += covariance
        squares = np.empty((len(self.gram), 6, 6))
        squares[:, *PAIRS] = squares[:, *PAIRS[::-1]] = np.tensordot(self.gram, second, axes=2)
        return Moments(squares, self.count.astype(float))

    @property
    def own(self) -> Array:
        """(B, 6, p + 1, p + 1) second moments of each channel with itself."""
        return self.gram[:, _OWN]


def empty(parameters: int, layout: Noise) -> Statistics:
    """Return the statistics of no data for ``parameters`` unknowns."""
    bands, size = len(layout.bands), parameters + 1
    return Statistics(np.zeros((bands, len(_OWN), size, size)), np.zeros(bands, dtype=np.intp), layout)


def statistics(body: Body, fits: Iterable[Fit], layout: Noise) -> Statistics:
    """Return the statistics of some trials; memory does not grow with their number or length. Of standing only the
    posture counts (``STILL``).

    Raises
    ------
    TrialRefused
        No frame of a trial may be used.
    """
    total = empty(10 * len(body.segments), layout)
    for fit in fits:
        if not fit.use.any():
            raise TrialRefused(
                f"Trial {fit.name}: no frame may be used (ground contact not measured, or markers hidden in all "
                "frames)."
            )
        for pick in layout.bands.runs(fit.use, fit.motion.rate):
            moved = segment_motion(body, fit.motion.at(pick))
            rows = regressor_of(moved, gravity=body.gravity, sharing=body.sharing)
            rows = np.concatenate([rows, fit.wrench.value[pick][:, :, None]], axis=2)
            # Root of the time mean of squared displacement, the largest of all segments.
            away = np.sum((moved.position - moved.position.mean(axis=0)) ** 2, axis=-1)
            still = bool(np.sqrt(np.max(np.mean(away, axis=0))) < _STILL) and not layout.bands.white
            total.add(rows, fit.motion.rate, fit.cutoff, POSTURE_BANDS if still else None)
    return total


_LEVER = 0.5
"""m: the same limit for moments about the standing point."""
_AROUND = 0.5
"""s before and after such a frame that are masked too, and in which the largest load counts."""


def believable(body: Body, fit: Fit, about: Array) -> tuple[Fit, str]:
    """Return the trial without frames in which table and plates differ by more than ``fit.outlier`` of the load, and a
    sentence or "".

    The load is the weight m g, or the largest force that the plates show in the half second around, if that is more: a
    runner's plates carry 2.7 weights. What a wrong body gets wrong, the sum of dm (g + a), grows with the accelerations
    of its segments, and so does what soft tissue and filters smear in time: both are shares of the peak of a stance,
    not of the weight. A chair, a wrong zero or a posture that jumps change the plates' own load little or not at all.
    """
    weight = -float(body.gravity[2]) * float(body.sip.mass.sum())
    # About the trial's own standing point: moments about the distant origin would be forces again.
    difference = wrench_about_point(fit.wrench.value - predict_wrench(body, fit.motion).value, about)
    # Force or moment over its lever, whichever is larger, in newtons.
    size = np.maximum(np.linalg.norm(difference[:, :3], axis=1), np.linalg.norm(difference[:, 3:], axis=1) / _LEVER)
    around = max(1, round(_AROUND * fit.motion.rate)) if np.isfinite(fit.motion.rate) else 1
    carried = np.nan_to_num(np.linalg.norm(fit.wrench.force, axis=1))
    limit = fit.outlier * np.maximum(weight, maximum_filter1d(carried, 2 * around + 1, mode="nearest"))
    wrong = fit.use & (size > limit)
    if not wrong.any():
        return fit, ""
    # Filters smear a wrong frame into its neighbours: they are masked, too.
    left = fit.use & ~binary_dilation(wrong, iterations=around)
    worst = int(np.argmax(np.where(wrong, size / limit, -1.0)))
    return replace(fit, use=left), (
        f"{fit.name}: {int((fit.use & ~left).sum())} of {int(fit.use.sum())} frames left out, the motion needs up to "
        f"{size[worst]:.0f} N more than the plates show (at {fit.motion.time[worst]:.2f} s, limit {limit[worst]:.0f} "
        f"N): look for a posture that jumps or a contact beside the plates."
    )


def usable(body: Body, fits: tuple[Fit, ...]) -> tuple[tuple[Fit, ...], Array, tuple[str, ...]]:
    """Return the trials with believable frames, the standing point (3,) m, and what was left out in words.

    Raises
    ------
    TrialRefused
        There is no trial, or none has a usable frame.
    """
    some = tuple(fit for fit in fits if fit.use.any())
    if not some:
        raise TrialRefused(
            f"None of {len(fits)} trials has a frame to identify from: ground contact not measured or no motion. "
            f"Record trials to fit."
        )
    blind = [fit.name for fit in fits if not fit.use.any()]
    about = standing_point(some)
    gated = tuple(believable(body, fit, standing_point((fit,))) for fit in some)
    notes = [f"Left out, no usable frame: {', '.join(blind)}."] if blind else []
    notes += [sentence for _, sentence in gated if sentence]
    used = tuple(fit for fit, _ in gated if fit.use.any())
    if not used:
        raise TrialRefused(f"No frame is left to identify from. {' '.join(notes)}")
    return used, about, tuple(notes)


def standing_point(fits: tuple[Fit, ...]) -> Array:
    """Return the mean centre of pressure (3,) m of all used frames: the point about which the wrench's noise is
    described.
    """
    points = np.concatenate([fit.wrench.cop()[fit.use] for fit in fits])
    loaded = points[np.isfinite(points).all(axis=1)]
    return loaded.mean(axis=0) if len(loaded) else np.zeros(3)


START = np.diag([8.0**2] * 3 + [4.0**2] * 3)
"""(6, 6) N², N²·m²: where learning starts, the paper's own residual (7.8 N, 4.3 N·m)."""
WORTH = 6.0
"""Coefficients' worth of the start that every band keeps."""


_SETTLED = 1e-3
"""Share by which a covariance may still change when learning ends."""


@one_thread()
def learn_noise(data: Statistics, prior: Sip, *, rounds: int = 12, start: Array = START) -> Noise:
    """Return the noise of the session, after at most ``rounds`` or once nothing changes beyond a thousandth; ``start``
    (6, 6) N², N·m, N²·m² as for people by default.
    """

    def improved(noise: Noise) -> Noise:
        moments = data.moments(*mean_and_covariance(data.normal_matrix(noise), prior))
        return replace(noise, covariance=noise_of(moments, start=start, worth=WORTH))

    first = Noise(np.tile(start, (len(data.count), 1, 1)), data.layout.about, data.layout.bands)
    return maximise(first, improved, lambda one: one.covariance, rounds=rounds, tolerance=_SETTLED)
