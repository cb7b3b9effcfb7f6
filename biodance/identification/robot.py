"""What a robot weighs, link by link, from encoders and a force plate: the identification of people with the errors that
a robot's laboratory makes.

Encoders are exact but for their zeros, joints are where the drawing has them; where on the plate the robot stood is
known to what the drawing's own errors allow. All of this enters as independent sources of error (`mismatch`), so that
intervals hold with them.
"""

from dataclasses import dataclass, replace

import numpy as np

from biodance.body.body import Body
from biodance.identification.base_parameters import BaseEstimate, BaseParameters, estimate_base
from biodance.identification.identification import Identification, conclude
from biodance.identification.learning import START, learn_noise
from biodance.identification.mismatch import Mismatch, long_runs
from biodance.identification.robot_errors import THINNED, place_changes, places_of, zero_changes
from biodance.identification.statistics import Fit, layout_for, statistics_together, usable
from biodance.motion.dynamics import regressor
from biodance.motion.grounded import Grounded
from biodance.records import Array, Wrench
from biodance.threads import one_thread
from biodance.uncertainty.bands import WHITE, Bands
from biodance.uncertainty.noise import Noise
from biodance.uncertainty.plates import plate_errors, plate_sources
from biodance.uncertainty.tolerances import REFERENCE_PERSON

_BANDS = Bands((0.0, 0.04, 0.3, 1.0, 2.5), 25.0)
"""Hz. What a motion needs beyond is the encoders' noise, twice differentiated, more than the motion; parameters that
explain it come out small (regression dilution): with 6 Hz a robot of 7.36 kg in MuJoCo was found 70 g light and its
inertias were further from the truth than the drawing's, with 2.5 Hz it is found within 7 g.
"""
_ROUNDS = 4


@dataclass(frozen=True, eq=False)
class RobotMotion:
    """One trial ready to identify from: ``fit`` in the frame of the first standing sole, and the ``angle`` (T, n) rad
    that ``grounded`` follows from.
    """

    fit: Fit
    angle: Array
    grounded: Grounded


def robot_fit(name: str, found: Grounded, angle: Array, measured: Array) -> RobotMotion:
    """Return a trial with its ``measured`` wrench (T, 6) in the frame of the first standing sole, NaN unknown."""
    use = found.use & np.isfinite(measured).all(axis=1)
    wrench = Wrench(found.motion.time, measured)
    return RobotMotion(Fit(name, found.motion, wrench, use), angle, found)


def innovation(body: Body, one: RobotMotion) -> float:
    """Return the RMS of what the drawing leaves of a trial's wrench, over what its own standard deviations allow.

    Channels count in units of their allowance, to which the start of the noise is added; 1 is usual.
    """
    pick = np.flatnonzero(one.fit.use)[:: 4 * THINNED]
    motion = one.fit.motion.at(pick)
    W = regressor(body, motion)
    left = one.fit.wrench.value[pick] - W @ body.sip.phi
    allowed = np.einsum("tci,ij,tcj->tc", W, body.sip.covariance, W, optimize=True) + np.diag(robot_start(body))
    return float(np.sqrt(np.mean(left**2 / allowed)))


@one_thread()
def identify_links(body: Body, trials: tuple[RobotMotion, ...]) -> tuple[Identification, BaseEstimate]:
    """Return the parameters of a robot from its ``trials``, with ``body.sip`` (the drawing) as prior; and the base
    parameters as the paper counts them: every frame independent, noise alone.

    Raises
    ------
    TrialRefused
        No trial has a usable frame.
    """
    fits, about, notes = usable(body, tuple(one.fit for one in trials))
    layout = layout_for(about, _BANDS)
    total = statistics_together(body, fits, layout)
    noise, _ = learn_noise(total, body.sip, start=robot_start(body))
    by_name = {fit.name: fit for fit in fits}
    found = _errors(body, tuple((by_name[one.fit.name], one) for one in trials if one.fit.name in by_name), noise)
    done = conclude(body, total, tuple(by_name), noise=noise, found=found, prior=body.sip, machine=True)
    return replace(done, notes=(*notes, *done.notes)), _as_the_paper(body, fits, about, done.base.base)


def _as_the_paper(body: Body, fits: tuple[Fit, ...], about: Array, base: BaseParameters) -> BaseEstimate:
    """Return the base parameters by weighted least squares on frames that count as independent (paper eq. 7), no prior:
    sigma from what the fit itself leaves of every channel and (W' W)^-1.
    """
    layout = layout_for(about, WHITE)
    total = statistics_together(body, fits, layout)
    noise, phi = replace(layout, covariance=robot_start(body)[None]), np.zeros(10 * len(body.segments))
    for _ in range(_ROUNDS):
        found = estimate_base(total.information(noise), base)
        phi[list(base.columns)] = found.value
        left = total.moments(phi, np.zeros((phi.size, phi.size))).residual[0]
        noise = replace(noise, covariance=np.diag(np.diag(left) / (total.count[0] - found.rank / 6))[None])
    return found


def robot_start(body: Body) -> Array:
    """Return the noise (6, 6) that learning starts with: that of a person, as much smaller as the robot is lighter."""
    return np.asarray(START * (float(body.sip.mass.sum()) / REFERENCE_PERSON) ** 2)


def _errors(body: Body, trials: tuple[tuple[Fit, RobotMotion], ...], noise: Noise) -> Mismatch:
    """Return the scores of encoder zeros, of plate faults (one plate for all trials) and of places."""
    size, plates = 10 * len(body.segments), plate_sources()
    encoders, faults = np.zeros((size, len(body.joints))), np.zeros((size, len(plates.delay)))
    places = []
    for fit, one in trials:
        place = np.zeros((size, places_of(one.grounded)))
        changes = zero_changes(body, one.grounded, one.angle)
        white = noise.at(fit.motion.rate)
        for _, pick in long_runs((fit,), noise.bands):
            motion = fit.motion.at(pick)
            W = regressor(body, motion)
            weight, wrench = white.weighted(W), W @ body.sip.phi
            encoders += np.tensordot(weight, changes[pick // THINNED], axes=((0, 1), (0, 1)))
            faults += np.tensordot(weight, plate_errors(wrench, motion.rate, noise, plates), axes=((0, 1), (0, 1)))
            place += np.tensordot(weight, place_changes(wrench, one.grounded, pick), axes=((0, 1), (0, 1)))
        places.append(place)
    return Mismatch(encoders, np.concatenate([faults, *places], axis=1))
