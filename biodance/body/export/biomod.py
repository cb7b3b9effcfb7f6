"""bioMod (version 4), the model format of biorbd and bioptim.

biorbd turns segments about their own x, y or z only, so that every degree of freedom is a segment without mass, named
as the joint, whose x axis lies along the joint's axis; the segment with the mass follows it, back in the body's own
frame. The root moves by translations x y z and rotations x y z (body-fixed) in the lab frame, z up.
"""

import numpy as np

from biodance.body.body import Body
from biodance.body.export import link_names, plain_name, row
from biodance.body.parts import rigid_inertia
from biodance.records import Array

FORMAT = "biomod"
SUFFIX = ".bioMod"


def text(body: Body, source: str) -> str:
    """Return the .bioMod of ``body``."""
    lines = ["version 4", "", *([f"// {source}", ""] if source else []), f"gravity {row(body.gravity)}", ""]
    if body.n_root:
        ranges = ["rangesQ", *["  -100 100"] * 3, *["  -10 10"] * 3]
        lines += _segment(body.segments[0], ["translations xyz", "rotations xyz", *ranges, *_mass(body, 0)])
    links = link_names(body)
    for i, joint in enumerate(body.joints):
        other = np.eye(3)[np.argmin(np.abs(joint.axis))]
        y = np.cross(other, joint.axis)
        y = y / np.linalg.norm(y)
        # First column the joint's axis: biorbd turns about the segment's own x.
        turn = np.stack([joint.axis, y, np.cross(joint.axis, y)], axis=1)
        above = links[joint.parent] if joint.parent >= 0 else body.segments[0] if body.n_root else ""
        placed = [*([f"parent {above}"] if above else []), *_placed(joint.rotation @ turn, joint.translation)]
        limits = f"rangesQ {row([body.limits.lower[i], body.limits.upper[i]])}"
        lines += _segment(joint.name, [*placed, "rotations x", limits])
        # Back by turn': the segment with mass has the axes of the body again.
        back = [f"parent {joint.name}", *_placed(turn.T, np.zeros(3))]
        lines += _segment(links[i], [*back, *(_mass(body, joint.segment) if joint.segment >= 0 else ())])
    markers = body.markers
    for name, segment, position in zip(markers.names, markers.segment, markers.position, strict=True):
        place = [f"  parent {body.segments[segment]}", f"  position {row(position)}", "  technical 1"]
        lines += [f"marker {plain_name(name)}", *place, "endmarker", ""]
    return "\n".join(lines)


def _segment(name: str, lines: list[str]) -> list[str]:
    return [f"segment {name}", *(f"  {line}" for line in lines), "endsegment", ""]


def _placed(rotation: Array, translation: Array) -> list[str]:
    rows = [f"  {row([*rotation[i], translation[i]])}" for i in range(3)]
    return ["RTinMatrix 1", "RT", *rows, "  0 0 0 1"]


def _mass(body: Body, segment: int) -> list[str]:
    lump = rigid_inertia(body.sip.of(body.segments[segment]))
    return [f"mass {row([lump.mass])}", "inertia", *(f"  {row(line)}" for line in lump.inertia), f"com {row(lump.com)}"]
