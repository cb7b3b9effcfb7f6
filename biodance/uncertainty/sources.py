"""The elementary sources of error of a person who is not the model: skin, flesh, joint centres, hinges, each one by
itself in unit size.

A source displaces model markers, centres of mass or segments at unchanged coordinates; the coordinates answer through
the inverse kinematics and the wrench changes (`response`), all to first order. Every kind of source says this twice,
forward - what one unit adds to the wrench and leaves of the markers - and as the transpose - what given weights on
the wrench make of it. Identification sends the columns of its regressor back, diagnosis sends the sources forward; a
test holds the two equal.
"""

from dataclasses import dataclass

import numpy as np

from biodance.body.body import Body
from biodance.body.tables.error_sizes import error_size, joint_size
from biodance.errors import UnknownName
from biodance.records import Array, Motion
from biodance.uncertainty.joints import Centre, Tilt
from biodance.uncertainty.response import ErrorSource, Response
from biodance.uncertainty.soft_tissue import Flesh, Sag, Slide


def deviations(body: Body, sources: tuple[ErrorSource, ...]) -> Array:
    """Return (K,) standard deviations of all errors of ``sources``, each in its own unit.

    A joint that a functional calibration placed has the standard deviation that came with it (``body.joint_errors``),
    every other one that of the table before calibration.
    """
    calibrated = {error.joint: {"joint_centre": error.centre, "tilt": error.axis} for error in body.joint_errors}
    found: dict[tuple[str, str], float] = {}
    for group, joint in (
        (group, joint) for source in sources for group, joint in zip(source.groups, source.joints, strict=True)
    ):
        quantity, _, target = group.partition(" ")
        if (group, joint) not in found:
            found[group, joint] = (
                calibrated[joint][quantity] if joint in calibrated else _of_table(quantity, target, joint)
            )
    return np.array([found[pair] for source in sources for pair in zip(source.groups, source.joints, strict=True)])


def _of_table(quantity: str, target: str, joint: str) -> float:
    """Return the size of one kind of error as the table has it."""
    if joint:
        return joint_size(quantity, joint)
    if quantity == "slide":
        return error_size("slide", "marker")
    try:
        return error_size(quantity, target)
    except UnknownName:
        return error_size(quantity, "other")


CLUSTER_REACH = 0.1
"""m: lever that makes a turn of a marker cluster comparable with its translation."""


def of_clusters(body: Body) -> tuple[ErrorSource, ...]:
    """Return the errors that diagnosis takes for no fault, the markers of a segment sliding as a whole; joint centres
    are causes there.
    """
    return (Slide(body, _patterns(body)), Sag(body), Flesh(body), Tilt(body))


def of_markers(body: Body) -> tuple[Slide, Flesh, Centre, Tilt]:
    """Return the errors with every marker sliding by itself: what identification discounts."""
    worn = [np.sum(np.array(body.markers.segment) == s) for s in range(len(body.segments))]
    # Pattern 3k + i moves marker k along axis i.
    alone = tuple(np.eye(3 * count).reshape(count, 3, 3 * count) for count in worn)
    return (Slide(body, alone), Flesh(body), Centre(body), Tilt(body))


@dataclass(frozen=True, eq=False)
class Errors:
    """What K elementary errors do in one trial.

    ``groups`` (K) such as ``slide thigh`` (m/rad), ``sag thigh`` (s²), ``flesh thigh`` (m/rad), ``joint_centre hip``
    (m), ``tilt knee`` (rad); ``joints`` (K) of the body that they belong to, or ""; ``wrench`` (T, 6, K) added to the
    predicted wrench, predicted less measured, about the lab origin; ``markers`` (M, 3, K) m, mean residual of every
    marker, model less measured, segment axes.
    """

    groups: tuple[str, ...]
    joints: tuple[str, ...]
    wrench: Array
    markers: Array


def forward(sources: tuple[ErrorSource, ...], motion: Motion) -> Errors:
    """Return what the errors of unit size do in ``motion``, at about 25 Hz (what is slower than 6 Hz is then good to
    1 %).
    """
    trial = Response.of(sources[0].body, motion)
    wrench = np.concatenate([trial.wrench(source.functional(trial)) for source in sources], axis=2)
    names, joints = (
        tuple(name for source in sources for name in getattr(source, which)) for which in ("groups", "joints")
    )
    return Errors(names, joints, wrench, np.concatenate([source.residual(trial) for source in sources], axis=2))


def transpose(sources: tuple[ErrorSource, ...], trial: Response, weight: Array) -> Array:
    """Return (K, p): sum over time of ``weight`` (F, 6, p), wrench about the lab origin, times what every error adds
    to the wrench.
    """
    back, sums = trial.back(weight), np.zeros((sum(len(source.groups) for source in sources), weight.shape[2]))
    for frames, part in trial.parts():
        sums += np.concatenate([source.transpose(part, back[frames]) for source in sources])
    return sums


def _patterns(body: Body) -> tuple[Array, ...]:
    """Return per segment the rigid displacements (m, 3, P) of its markers: three translations, and turns that are not
    null.
    """
    worn, found = np.array(body.markers.segment), []
    for s in range(len(body.segments)):
        places = body.markers.position[worn == s]
        middle = places - places.mean(axis=0) if len(places) else places
        # Turn about the markers' middle, in metres at `CLUSTER_REACH`, so that patterns have one unit.
        turns = [np.cross(axis, middle) / CLUSTER_REACH for axis in np.eye(3)]
        kept = [np.tile(axis, (len(places), 1)) for axis in np.eye(3)] + [
            turn for turn in turns if np.abs(turn).max(initial=0) > 1e-6
        ]
        found.append(np.stack(kept, axis=2) if len(places) else np.empty((0, 3, 0)))
    return tuple(found)
