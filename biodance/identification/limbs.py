"""Limbs unlike the table: a prosthesis, of whose matter little is known, and devices that were weighed.

The table expects right and left alike. Below the joint of a prosthesis nothing is known but that there is less than the
whole body: mass and place of every segment there are open, the rest of the body weighs what they do not, and nothing
ties them to the other side.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from biodance.body.body import Body
from biodance.body.tables.error_sizes import error_size
from biodance.display import spaced
from biodance.identification.loads import unit_load
from biodance.lab.markers.sets import other_side
from biodance.records import Array, Sip, Subject
from biodance.uncertainty.caution import shift_slope


def segments_beyond(body: Body, segment: str) -> tuple[int, ...]:
    """Return the indices of ``segment`` and of all segments that hang on it."""
    own, parents = body.segment_joint, [joint.parent for joint in body.joints]
    first, found = own[body.segment_index(segment)], []
    # Walks up to the joint that carries `segment`: what reaches it hangs on it.
    for index, joint in enumerate(own):
        while joint > first:
            joint = parents[joint]
        found += [index] if joint == first else []
    return tuple(found)


def limb_and_rest(body: Body, segment: str, phi: Array) -> tuple[Array, Array, Array]:
    """Return the parameters (10N,) of 1 kg, in the proportions of ``phi`` (10N,), of the limb from ``segment`` on, of
    that of the other side, and of the body without both.
    """
    every = np.arange(len(body.segments))
    own, other = (np.isin(every, segments_beyond(body, limb)) for limb in (segment, other_side(segment)))
    parts = [phi * np.repeat(part, 10) for part in (own, other, ~(own | other))]
    first, second, rest = (part / part[::10].sum() for part in parts)
    return first, second, rest


def with_open_limb(body: Body, segment: str) -> Body:
    """Return ``body`` whose limb from ``segment`` on is a prosthesis: the masses there known to the share
    `unequal_limb mass`, and their places to `unequal_limb place`.
    """
    place = None if body.at_joint is None else _opened(body, body.at_joint, segment)
    return replace(body, sip=_opened(body, body.sip, segment), at_joint=place)


def _opened(body: Body, table: Sip, segment: str) -> Sip:
    covariance, limb = np.array(table.covariance), segments_beyond(body, segment)
    share, way = error_size("unequal_limb", "mass"), error_size("unequal_limb", "place")
    rest = table.phi * ~np.repeat(np.isin(np.arange(len(body.segments)), limb), 10)
    for index in limb:
        own = slice(10 * index, 10 * index + 10)
        # The segment heavier by a share of itself, the rest of the body lighter by as much: total unchanged.
        less = -table.phi[10 * index] * rest / rest[::10].sum()
        less[own] = table.phi[own]
        covariance += share**2 * np.outer(less, less)
        slope = way * shift_slope(table.phi[own])
        covariance[own, own] += slope @ slope.T
    return replace(table, covariance=covariance)


def with_devices(body: Body, worn: Mapping[str, float]) -> Body:
    """Return ``body``, whose mass holds what is worn, with the masses ``worn`` (kg by segment) on their segments,
    known, each at a place in or near the segment's box, and the person lighter by them.
    """
    carried = sum(worn.values())
    if not carried:
        return body
    place = None if body.at_joint is None else _wearing(body, body.at_joint, worn, carried)
    return replace(body, sip=_wearing(body, body.sip, worn, carried), at_joint=place)


def _wearing(body: Body, table: Sip, worn: Mapping[str, float], carried: float) -> Sip:
    # The person without what is worn: lighter in proportion, covariance with the square.
    ratio = 1 - carried / float(table.mass.sum())
    phi, covariance = ratio * table.phi, ratio**2 * np.asarray(table.covariance)
    for segment, mass in worn.items():
        index = body.segment_index(segment)
        own = slice(10 * index, 10 * index + 10)
        mean, factor = unit_load(body, index)
        phi[own] += mass * mean
        # A load of m kg: mean m u, covariance m² G G'.
        covariance[own, own] += mass**2 * factor @ factor.T
    return replace(table, phi=phi, covariance=covariance)


def with_declared_limbs(body: Body, subject: Subject) -> tuple[Body, str]:
    """Return the body with the devices and the prosthesis that were declared of the ``subject``, and both in words."""
    said = []
    if subject.devices:
        body = with_devices(body, subject.devices)
        worn = ", ".join(f"{mass:g} kg on the {spaced(segment)}" for segment, mass in subject.devices.items())
        said.append(f"Its table holds what is worn: {worn}.")
    if subject.prosthesis:
        body = with_open_limb(body, subject.prosthesis)
        said.append(f"From the {spaced(subject.prosthesis)} on it is a prosthesis, which no table knows.")
    return body, " ".join(said)
