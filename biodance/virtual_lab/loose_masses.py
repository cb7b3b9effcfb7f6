"""Masses that are not fixed to the bone: flesh on springs, a load that sloshes. Integrated as what they are, spring and damper.

A mass m hangs at a point p(t) of a segment by a spring and a damper: z'' = -w² z - 2 d w z' - p'', with z its displacement from where it
rests. The ground carries m (p'' + z'' - g) at p + z instead of m (p'' - g) at p; minus the difference is the force
on the person.
"""

from dataclasses import dataclass

import numpy as np

from biodance.errors import UnknownName
from biodance.motion.regressor import GRAVITY
from biodance.records import Array
from biodance.virtual_lab.forces import true_poses
from biodance.virtual_lab.merge import CARRIERS, MERGED
from biodance.virtual_lab.performance import Force, Performance
from biodance.virtual_lab.person import AddedLoad, Person
from biodance.virtual_lab.skeleton import SEGMENTS


@dataclass(frozen=True)
class Spring:
    """How a loose mass hangs: ``frequency`` Hz undamped, ``damping`` ratio, ``free`` (3,) 1 or 0 = it can move along lab x, y, z."""

    frequency: float
    damping: float
    free: tuple[float, float, float] = (1.0, 1.0, 1.0)


FLESH = {"trunk_head": Spring(5.5, 0.3)}
"""Viscera; other flesh hangs on `MUSCLE`."""
MUSCLE = Spring(9.0, 0.3)
LIQUID = Spring(1.3, 0.08, (1.0, 1.0, 0.0))


def swing(acceleration: Array, step: float, spring: Spring) -> tuple[Array, Array]:
    """Return z (T, 3) m and z'' (T, 3) m/s² of a mass on a spring whose foot moves with ``acceleration`` (T, 3) m/s², from rest.

    ``step`` s between samples; exact for an acceleration that is linear between samples.
    """
    from scipy.signal import cont2discrete, lfilter, ss2tf

    w, damping = 2 * np.pi * spring.frequency, spring.damping
    A, B = np.array([[0.0, 1.0], [-w * w, -2 * damping * w]]), np.array([[0.0], [-1.0]])
    discrete = cont2discrete((A, B, np.eye(2), np.zeros((2, 1))), step, method="foh")
    numerator, denominator = ss2tf(*discrete[:4])
    z, rate = (lfilter(row, denominator, acceleration, axis=0) for row in numerator)
    return z, -w * w * z - 2 * damping * w * rate - acceleration


def loose(segment: str, place: Array, mass: float, spring: Spring) -> Force:
    """Return the force of ``mass`` kg, counted as fixed at ``place`` (3,) m of a true segment but hanging there on a spring."""

    def act(performance: Performance, time: Array) -> Array:
        from scipy.interpolate import make_interp_spline

        point = true_poses(performance, time).points([SEGMENTS.index(segment)], place[None])[:, 0]
        acceleration = make_interp_spline(time, point, k=5).derivative(2)(time)
        z, z2 = (np.array(spring.free) * curve for curve in swing(acceleration, float(time[1] - time[0]), spring))
        moment = np.cross(point + z, mass * (acceleration + z2 - GRAVITY)) - np.cross(point, mass * (acceleration - GRAVITY))
        return -np.concatenate([mass * z2, moment], axis=1)

    return act


def wobbling_mass(person: Person, target: str, mass: float) -> Force:
    """Return the force of ``mass`` kg of the flesh of one of the 12 segments that is not fixed to its bone."""
    segment = _carrier(target)
    return loose(segment, person.body.sip.com[SEGMENTS.index(segment)], mass, FLESH.get(target, MUSCLE))


def sloshing_load(person: Person, target: str, mass: float, sloshing: float) -> tuple[AddedLoad, Force]:
    """Carry a vessel of ``mass`` kg behind one of the 12 segments, of which ``sloshing`` kg move: the load, and what sloshing adds."""
    segment = _carrier(target)
    place = person.body.sip.com[SEGMENTS.index(segment)] + np.array([-0.16, 0.0, 0.0])
    return AddedLoad(segment, mass, place, np.full(3, 0.05)), loose(segment, place, sloshing, LIQUID)


def _carrier(target: str) -> str:
    if target not in MERGED:
        raise UnknownName.of("segment of the 12-segment model", target, tuple(MERGED))
    return CARRIERS.get(target, target)
