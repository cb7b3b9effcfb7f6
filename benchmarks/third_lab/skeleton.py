"""The skeleton: 22 segments, each on three hinges (flexion y, abduction x, rotation z); mechanics by pinocchio."""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin
from scipy.interpolate import BSpline
from scipy.spatial.transform import Rotation

from benchmarks.third_lab.faults import Array

if TYPE_CHECKING:
    from benchmarks.third_lab.people import Person

SIDES = {"right": -1, "left": 1}  # sign of y
GRAVITY = np.array([0.0, 0.0, -9.81])
PARENTS: dict[str, str] = {"pelvis": "", "lumbar": "pelvis", "waist": "lumbar", "thorax": "waist", "neck": "thorax",
                           "head": "neck"}  # fmt: skip
for _side in SIDES:
    PARENTS |= {
        f"{_side}_clavicle": "thorax", f"{_side}_upper_arm": f"{_side}_clavicle",
        f"{_side}_forearm": f"{_side}_upper_arm", f"{_side}_hand": f"{_side}_forearm",
        f"{_side}_thigh": "pelvis", f"{_side}_shank": f"{_side}_thigh", f"{_side}_foot": f"{_side}_shank",
        f"{_side}_toes": f"{_side}_foot",
    }  # fmt: skip
NAMES = list(PARENTS)
# q: position of the pelvis (3), its yaw, pitch, roll (z, y, x), then three hinges (y, x, z) of each other segment.
COLUMNS = {name: slice(3 + 3 * i, 6 + 3 * i) for i, name in enumerate(NAMES)}
WIDTH = 3 + 3 * len(NAMES)


def pose_segments(person: "Person", q: Array) -> tuple[dict[str, Array], dict[str, Array]]:
    """Place all segments.

    Parameters
    ----------
    person : Person
    q : array, shape (n, WIDTH)
        m and rad.

    Returns
    -------
    rotations : dict of str to array, shape (n, 3, 3)
        Segment to world.
    places : dict of str to array, shape (n, 3)
        Proximal joint in the world, m.
    """
    rotations = {"pelvis": Rotation.from_euler("ZYX", q[:, COLUMNS["pelvis"]]).as_matrix()}
    places = {"pelvis": q[:, :3]}
    for name, parent in PARENTS.items():
        if parent:
            own = Rotation.from_euler("YXZ", q[:, COLUMNS[name]]).as_matrix()
            rotations[name] = rotations[parent] @ own
            places[name] = places[parent] + rotations[parent] @ person.offsets[name]
    return rotations, places


def build_model(person: "Person") -> pin.Model:
    """Build the person for pinocchio: one hinge after another, the mass on the last of each three."""
    model = pin.Model()
    model.gravity.linear = GRAVITY
    here = model.addJoint(0, pin.JointModelTranslation(), pin.SE3.Identity(), "place")
    last: dict[str, int] = {"": here}
    hinges = {"x": pin.JointModelRX, "y": pin.JointModelRY, "z": pin.JointModelRZ}
    for name, parent in PARENTS.items():
        joint, at = last[parent], pin.SE3(np.eye(3), person.offsets[name])
        for axis in "yxz" if parent else "zyx":
            joint = model.addJoint(joint, hinges[axis](), at, f"{name}_{axis}")
            at = pin.SE3.Identity()
        last[name] = joint
        inertia = pin.Inertia(person.masses[name], person.coms[name], person.inertias[name])
        model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
    return model


def order_columns(model: pin.Model) -> Array:
    """Columns of q in the order in which pinocchio numbers its joints (it numbers by depth of the call)."""
    order = np.empty(WIDTH, int)
    order[model.idx_qs[model.getJointId("place")] :][:3] = [0, 1, 2]
    for name, parent in PARENTS.items():
        for k, axis in enumerate("yxz" if parent else "zyx"):
            order[model.idx_qs[model.getJointId(f"{name}_{axis}")]] = COLUMNS[name].start + k
    return order


def find_wrench(person: "Person", path: BSpline, times: Array) -> tuple[Array, Array]:
    """Force and moment that the ground must give for this movement.

    Parameters
    ----------
    person : Person
    path : BSpline
        q over time, at least twice differentiable.
    times : array, shape (n,)
        s.

    Returns
    -------
    forces, moments : array, shape (n, 3)
        N, and N·m about the origin of the world.
    """
    model = build_model(person)
    data, order = model.createData(), order_columns(model)
    q, v, a = (path(times, order_)[:, order] for order_ in (0, 1, 2))
    forces, moments = np.empty((2, len(times), 3))
    for i in range(len(times)):
        pin.rnea(model, data, q[i], v[i], a[i])
        forces[i], moments[i] = data.f[1].linear, data.f[1].angular  # the first joint only shifts: axes of the world
    return forces, moments + np.cross(path(times)[:, :3], forces)


def add_mass(person: "Person", name: str, mass: float, place: Array, radius: float = 0.04) -> "Person":
    """Fix a ball (kg, place in the segment's frame in m, radius in m) to a segment; a new person."""
    old = pin.Inertia(person.masses[name], person.coms[name], person.inertias[name])
    new = old + pin.Inertia(mass, place, 0.4 * mass * radius**2 * np.eye(3))
    return replace(
        person,
        masses=person.masses | {name: new.mass},
        coms=person.coms | {name: new.lever},
        inertias=person.inertias | {name: new.inertia},
    )
