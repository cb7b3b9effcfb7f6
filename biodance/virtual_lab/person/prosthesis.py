"""A virtual person with a prosthesis in place of a part of a limb."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from biodance.errors import BiodanceError, UnknownName
from biodance.records import Sip
from biodance.virtual_lab.person.person import Person, of_parameters, parameters_of_inertia
from biodance.virtual_lab.person.skeleton import TRUE_SEGMENTS

_REPLACED = {"shank": ("shank", "foot"), "foot": ("foot",), "forearm": ("forearm", "hand")}
"""What a prosthesis replaces, by its first true segment."""
_STUMP = 0.85
"""Share of its length to which the matter of the first segment is squeezed towards the joint: a stump in a socket above
a tube."""


def with_prostheses(person: Person, lighter: Mapping[str, float]) -> Person:
    """Return the person with prostheses, each so many kg ``lighter`` than the limb from its first segment on.

    Raises
    ------
    UnknownName
        No prosthesis begins there.
    BiodanceError
        The limb does not weigh as much.
    """
    sip = person.body.sip
    for segment, less in lighter.items():
        sip = _fit_prosthesis(sip, segment, less)
    return replace(person, body=replace(person.body, sip=sip))


def _fit_prosthesis(sip: Sip, segment: str, less: float) -> Sip:
    """Return the true parameters of somebody whose limb from ``segment`` on (a shank, foot or forearm) is a prosthesis
    that is ``less`` kg lighter than the limb was; on the scale the person weighs what was declared, so that all other
    segments weigh more.
    """
    side, _, first = segment.removesuffix("_hand").partition("_")
    if first not in _REPLACED or side not in ("right", "left"):
        legal = tuple(f"{side}_{one}" for side in ("right", "left") for one in _REPLACED)
        raise UnknownName.of("segment that a prosthesis begins with", segment, legal)
    limb = [TRUE_SEGMENTS.index(f"{side}_{part}") for part in _REPLACED[first]]
    bodies, mass = [of_parameters(phi) for phi in sip.phi.reshape(-1, 10)], float(sip.mass[limb].sum())
    if not 0 < less < mass:
        raise BiodanceError(
            f"{segment}: the limb weighs {mass:.2f} kg; it can be 0 to {mass:.2f} kg lighter, not {less}."
        )
    squeezed = np.diag([1.0, _STUMP, 1.0, 1.0])
    bodies[limb[0]] = squeezed @ bodies[limb[0]] @ squeezed
    total = float(sip.mass.sum())
    scale = [1 - less / mass if k in limb else 1 + less / (total - mass) for k in range(len(bodies))]
    phi = np.concatenate([parameters_of_inertia(times * J) for times, J in zip(scale, bodies, strict=True)])
    return Sip(sip.segments, phi, sip.covariance)
