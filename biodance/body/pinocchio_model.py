"""Build the pinocchio model of a Body, after checking that pinocchio loads on this machine."""

from typing import TYPE_CHECKING, Any

import numpy as np

from biodance.errors import MissingLibrary

if TYPE_CHECKING:
    import pinocchio as pin

    from biodance.body.body import Body


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


def build(body: "Body") -> "pin.Model":
    """Return a pinocchio model with the joints of ``body`` in order and the inertias of ``body.sip``."""
    pin = load_pinocchio()
    model = pin.Model()
    model.name = body.name
    model.gravity.linear = np.array(body.gravity)
    root = 0
    if body.n_root:
        root = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root")
    ids: list[int] = []
    limits = body.limits
    for i, joint in enumerate(body.joints):
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
    for i, name in enumerate(body.segments):
        j = body.segment_joint[i]
        owner = root if j < 0 else ids[j]
        inertia = pin.Inertia.FromDynamicParameters(np.array(body.sip.of(name)))
        model.appendBodyToJoint(owner, inertia, pin.SE3.Identity())
    return model
