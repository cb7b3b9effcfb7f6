"""MJCF: the model format of MuJoCo, which refuses an inertia that breaks the triangle inequality. One body per segment
with its hinges in order; markers are sites; boxes are seen but never touched (no contact).
"""

from xml.etree.ElementTree import Element

import numpy as np

from biodance.body.body import Body
from biodance.body.export import WORLD, Branch, add, row, segment_tree, six, xml_document
from biodance.body.parts import rigid_inertia

FORMAT = "mjcf"
SUFFIX = ".xml"


def text(body: Body, source: str) -> str:
    """Return the MJCF of ``body``; the root's free joint is named ``root``."""
    root = Element("mujoco", model=body.name)
    add(root, "compiler", angle="radian", autolimits="true", inertiafromgeom="false", balanceinertia="false")
    add(root, "option", gravity=row(body.gravity))
    world = add(root, "worldbody")
    made: dict[int, Element] = {WORLD: world}
    for branch in segment_tree(body):
        made[branch.segment] = _body(made[branch.parent], body, branch)
    markers = body.markers
    for name, segment, position in zip(markers.names, markers.segment, markers.position, strict=True):
        add(made[segment], "site", name=name, pos=row(position), size="0.007")
    return xml_document(root, source)


def _body(parent: Element, body: Body, branch: Branch) -> Element:
    name = body.segments[branch.segment]
    x_axis, y_axis = branch.rotation[:, 0], branch.rotation[:, 1]
    element = add(parent, "body", name=name, pos=row(branch.translation), xyaxes=row([*x_axis, *y_axis]))
    if branch.parent == WORLD and body.n_root:
        add(element, "freejoint", name="root")
    for hinge in branch.hinges:
        place = {"axis": row(hinge.axis), "pos": row(hinge.place)}
        joint = add(element, "joint", name=body.joints[hinge.joint].name, type="hinge", **place)
        low, high = body.limits.lower[hinge.joint], body.limits.upper[hinge.joint]
        if low < high:
            joint.set("range", row([low, high]))
    lump = rigid_inertia(body.sip.of(name))
    add(element, "inertial", pos=row(lump.com), mass=row([lump.mass]), fullinertia=six(lump.inertia))
    low, high = body.boxes[branch.segment]
    if np.all(high > low):
        place = {"pos": row((low + high) / 2), "size": row((high - low) / 2)}
        add(element, "geom", type="box", **place, contype="0", conaffinity="0", rgba=".7 .7 .7 .4")
    return element
