"""Build the pinocchio model of a Body, after checking that pinocchio loads on this machine."""

from typing import TYPE_CHECKING, Any

import numpy as np

from biodance.body.parts import Joint, JointLimits
from biodance.errors import MissingLibrary
from biodance.records import Array

if TYPE_CHECKING:
    import pinocchio as pin


def load_pinocchio() -> Any:
    """Import pinocchio.

    Raises
    ------
    MissingLibrary
        It does not load; on slim Linux containers the cause is the absent system library libgomp1.
    """
    try:
        import pinocchio
    except ImportError as error:
        cure = (
            "Install it: apt-get install libgomp1."
            if "libgomp" in str(error)
            else "Install biodance again with its constraints.txt."
        )
        raise MissingLibrary(f"pinocchio does not load ({error}). {cure}") from error
    return pinocchio


def build(
    name: str,
    joints: tuple[Joint, ...],
    limits: JointLimits,
    *,
    inertias: tuple[tuple[int, Array], ...],
    gravity: Array,
    free: bool,
) -> "pin.Model":
    """Return a pinocchio model with ``joints`` in order, on a ``free`` root or on the ground; ``gravity`` (3,) m/s².

    ``inertias``: of every segment the index of the joint that carries it (-1: the root) and its ten parameters.
    """
    pin = load_pinocchio()
    model = pin.Model()
    model.name = name
    model.gravity.linear = np.array(gravity)
    root = 0
    if free:
        root = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root")
    ids: list[int] = []
    for i, joint in enumerate(joints):
        parent = root if joint.parent < 0 else ids[joint.parent]
        placement = pin.SE3(np.array(joint.rotation), np.array(joint.translation))
        effort = max(-limits.torque_lower[i], limits.torque_upper[i])
        one = np.ones(1)
        ids.append(
            model.addJoint(
                parent,
                pin.JointModelRevoluteUnaligned(np.array(joint.axis)),
                placement,
                joint.name,
                effort * one,
                limits.velocity[i] * one,
                limits.lower[i] * one,
                limits.upper[i] * one,
            )
        )
    for carrier, parameters in inertias:
        inertia = pin.Inertia.FromDynamicParameters(np.array(parameters))
        model.appendBodyToJoint(root if carrier < 0 else ids[carrier], inertia, pin.SE3.Identity())
    return model
