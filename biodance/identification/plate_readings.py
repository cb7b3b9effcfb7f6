"""What the trials that were fitted tell of their plates: errors within the tolerances of installed ones (a millimetre,
some milliradians, a few per mille of crosstalk, a newton of zero), most probable beside the identified body. Intervals
count them; and since the same plates err alike in movement that was kept, every body is compared there with what the
fitted trials tell of the plates beside it.

With X = [W E], E the errors of one standard deviation each, X' S^-1 (y - W phi) is X' S^-1 E z, with noise and wrong
kinematics of the covariance of `mismatch`, and z ~ N(0, 1). At the identified phi, E[z | phi] is the mean that z would
have in a joint fit: the posterior is Gaussian, and phi its mean. Identification took for noise what the plates read,
and in the mean of a trial that is most of it: the noise is learned once more without.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from biodance.body.body import Body
from biodance.identification.identification import Identification
from biodance.identification.knowledge import SIGMAS
from biodance.identification.mismatch import PlateRows, inverse_root, mismatch, softness
from biodance.identification.statistics import START, WORTH, Fit, statistics, usable
from biodance.motion.dynamics import predict_wrench
from biodance.records import CHANNELS, Array, Wrench
from biodance.threads import Sendable
from biodance.uncertainty.bands import Noise
from biodance.uncertainty.learning import noise_of
from biodance.uncertainty.plates import plate_errors, plate_sources


@dataclass(frozen=True, eq=False)
class PlateReadings(Sendable):
    """Errors of the plates as fitted trials tell them.

    ``size`` (m,) of each source of `plates.SOURCES`, behind them of the corrections that were made (`Fit.doubts`), in
    their standard deviations; ``covariance`` (m, m); ``layout`` with the point that they are described about.
    """

    size: Array
    covariance: Array
    layout: Noise

    def rows(self, fit: Fit, body: Body) -> Array:
        """Return (T, 6, m) N, N·m about the lab origin: what one standard deviation of each adds to the wrench that the
        ``body`` needs in a trial.
        """
        wrench = predict_wrench(body, fit.motion).value
        rows = plate_errors(wrench, fit.motion.rate, self.layout, plate_sources())
        more = fit.doubts if fit.doubts.size else np.zeros((len(wrench), 6, len(self.size) - rows.shape[2]))
        return np.concatenate([rows, more], axis=2)

    def added(self, fit: Fit, body: Body) -> Array:
        """Return (T, 6) N, N·m about the lab origin: what these errors add to what the plates read in a trial."""
        return np.asarray(self.rows(fit, body) @ self.size)

    def told(self, fits: Sequence[Fit], body: Body) -> str:
        """Return in words what the plates read beside the ``body`` in the mean of some trials, with 95 % intervals; ""
        where nothing is sure.
        """
        frames = np.concatenate([self.rows(fit, body)[fit.use] for fit in fits])
        # Mean over the frames, then about the plates' point.
        rows = self.layout.shift @ frames.mean(axis=0)
        mean = rows @ self.size
        sd = np.sqrt(np.diag(rows @ self.covariance @ rows.T))
        sure = [
            f"{channel} {value:+.1f} ± {SIGMAS * one:.1f} {'N' if channel[0] == 'F' else 'N·m'}"
            for channel, value, one in zip(CHANNELS, mean, sd, strict=True)
            if abs(value) > SIGMAS * one
        ]
        return ", ".join(sure)


def plate_readings(found: Identification, fits: tuple[Fit, ...], *bodies: Body) -> tuple[PlateReadings, ...]:
    """Return what the trials that were fitted tell of their plates beside each of some bodies.

    Parameters
    ----------
    found : Identification
        With its noise, the sizes of what disturbs it, and how sure its parameters are.
    fits : tuple of Fit
        The trials that it was identified from, at least one; each with the doubts of the corrections made in it.
    *bodies : Body
        The identified one, and others in its place: the table's.

    Returns
    -------
    tuple of PlateReadings
        Mean and covariance of the errors beside each; the covariance counts how sure the identified parameters are.
    """
    used, about, _ = usable(found.body, fits)
    softer = softness(found.body, used, found.noise.bands)
    rows, told = _rows(found, used, found.noise, softer), []
    for body in bodies:
        first = _readings(found, rows, body)
        # What the plates read is taken off before the noise is learned again.
        off = tuple(replace(f, wrench=Wrench(f.wrench.time, f.wrench.value - first.added(f, body))) for f in used)
        left = statistics(found.body, off, Noise.unit(about, found.noise.bands))
        moments = left.moments(body.sip.phi, found.posterior.covariance)
        noise = replace(found.noise, covariance=noise_of(moments, start=START, worth=WORTH))
        told.append(_readings(found, _rows(found, used, noise, softer), body))
    return tuple(told)


def _rows(found: Identification, used: tuple[Fit, ...], noise: Noise, softer: float) -> PlateRows:
    """Return what the ``used`` trials tell of parameters and plates under a ``noise``, whatever the body; skin slides
    ``softer`` times as much as the table says.
    """
    rows = mismatch(found.body, used, noise, softer=softer, with_rows=True).rows
    assert rows is not None
    return rows


def _readings(found: Identification, rows: PlateRows, body: Body) -> PlateReadings:
    """Return what the ``rows`` tell of the plates beside a ``body``."""
    phi, H, sizes = body.sip.phi, rows.normal, found.sizes
    half = inverse_root(sizes.noise * H + sizes.kinematics**2 * rows.kinematics @ rows.kinematics.T)
    # half r with r = H (phi, z) + errors: columns of parameters and of plates, in units of the errors.
    of_body, of_plates = np.split(half @ H, [len(phi)], axis=1)
    # Posterior precision of z: data plus its unit-normal prior.
    after = np.linalg.inv(of_plates.T @ of_plates + np.eye(of_plates.shape[1]))
    gain = after @ of_plates.T
    slope = gain @ of_body
    # var(z) = var(z | phi) + D C D' with D = -gain of_body.
    covariance = after + slope @ found.posterior.covariance @ slope.T
    return PlateReadings(gain @ (half @ rows.target - of_body @ phi), covariance, Noise.unit(found.noise.about))
