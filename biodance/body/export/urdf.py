"""URDF: one link per degree of freedom, signed axes; read by pinocchio, ROS and most robotics tools.

The root link is free: readers add the free-flyer themselves. Links between the axes of one anatomical joint have no
inertia.
"""

from xml.etree.ElementTree import Element

from biodance.body.body import Body
from biodance.body.export import add, euler_angles, link_names, row, xml_document
from biodance.body.parts import rigid_inertia

FORMAT = "urdf"
SUFFIX = ".urdf"


def text(body: Body, source: str) -> str:
    """Return the URDF of ``body``."""
    root = Element("robot", name=body.name)
    if body.n_root:
        _link(root, body, body.segments[0], 0)
    else:
        add(root, "link", name="world")
    names, limits = link_names(body), body.limits
    for i, joint in enumerate(body.joints):
        _link(root, body, names[i], joint.segment)
        element = add(root, "joint", name=joint.name, type="revolute")
        first = body.segments[0] if body.n_root else "world"
        add(element, "parent", link=names[joint.parent] if joint.parent >= 0 else first)
        add(element, "child", link=names[i])
        add(element, "origin", xyz=row(joint.translation), rpy=row(euler_angles("xyz", joint.rotation)))
        add(element, "axis", xyz=row(joint.axis))
        effort = max(-limits.torque_lower[i], limits.torque_upper[i])
        ranges = {"lower": limits.lower[i], "upper": limits.upper[i], "velocity": limits.velocity[i], "effort": effort}
        add(element, "limit", **{name: row([value]) for name, value in ranges.items()})
    return xml_document(root, source)


def _link(root: Element, body: Body, name: str, segment: int) -> None:
    """Append one link; with inertia and box if it is a segment."""
    link = add(root, "link", name=name)
    if segment < 0:
        return
    lump = rigid_inertia(body.sip.of(body.segments[segment]))
    inertial = add(link, "inertial")
    add(inertial, "origin", xyz=row(lump.com), rpy="0 0 0")
    add(inertial, "mass", value=row([lump.mass]))
    pairs = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}
    add(inertial, "inertia", **{key: row([lump.inertia[pair]]) for key, pair in pairs.items()})
    low, high = body.boxes[segment]
    visual = add(link, "visual")
    add(visual, "origin", xyz=row((low + high) / 2), rpy="0 0 0")
    add(add(visual, "geometry"), "box", size=row(high - low))
