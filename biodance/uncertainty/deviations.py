"""How large every elementary error of a body is: from the one table, or from the functional calibration of its own
joints.
"""

import numpy as np

from biodance.body.body import Body
from biodance.body.tables.error_sizes import error_size, joint_size
from biodance.errors import UnknownName
from biodance.records import Array
from biodance.uncertainty.source import ErrorSource


def deviations(body: Body, sources: tuple[ErrorSource, ...]) -> Array:
    """Return (K,) standard deviations of all errors of ``sources``, each in its own unit.

    A joint that a functional calibration placed has the standard deviation that came with it (``body.joint_errors``),
    every other one that of the table before calibration.
    """
    placed = {error.joint: {"joint_centre": error.centre, "tilt": error.axis} for error in body.joint_errors}
    found: dict[tuple[str, str], float] = {}
    for group, joint in (
        (group, joint) for source in sources for group, joint in zip(source.groups, source.joints, strict=True)
    ):
        quantity, _, target = group.partition(" ")
        if (group, joint) not in found:
            found[group, joint] = placed[joint][quantity] if joint in placed else _of_table(quantity, target, joint)
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
