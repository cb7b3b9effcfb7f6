"""What XML model formats share: a body as a tree of segments on compound joints, and numbers without loss."""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from xml.etree.ElementTree import Comment, Element, SubElement, indent, tostring

import numpy as np

from biodance.body.body import Body
from biodance.body.parts import NO_SEGMENT
from biodance.errors import BiodanceError
from biodance.records import Array

WORLD = -1


@dataclass(frozen=True, eq=False)
class _Hinge:
    """One degree of freedom of a compound joint: index ``joint`` in ``Body.joints``; ``axis`` (3,) unit vector and
    ``place`` (3,) m of a point on it, both in the frame of the CHILD segment at zero angles.
    """

    joint: int
    axis: Array
    place: Array


@dataclass(frozen=True, eq=False)
class Branch:
    """How ``segment`` hangs on ``parent`` (an index, -1 = the world).

    ``rotation`` (3, 3) parent_R_segment and ``translation`` (3,) m of the segment's origin in the parent's frame, both
    at zero angles; ``hinges`` from the parent outwards: the segment turns by the product of their rotations, the first
    one leftmost.
    """

    segment: int
    parent: int
    rotation: Array
    translation: Array
    hinges: tuple[_Hinge, ...]


def segment_tree(body: Body) -> tuple[Branch, ...]:
    """Return the branches of all segments, every one behind that on which it hangs.

    Raises
    ------
    BiodanceError
        A link without segment carries more than one joint: such a tree has no compound joints.
    """
    outwards = sorted(range(len(body.segments)), key=lambda i: body.segment_joint[i])
    branches = tuple(_branch(body, i) for i in outwards)
    used = [hinge.joint for branch in branches for hinge in branch.hinges]
    twice = {body.joints[j].name for j in used if used.count(j) > 1}
    if twice:
        raise BiodanceError(
            f"{body.name}: two segments share the joint {min(twice)}. Give the link behind it a segment of its own."
        )
    return branches


def _branch(body: Body, segment: int) -> Branch:
    hinges: list[_Hinge] = []
    rotation, translation = np.eye(3), np.zeros(3)  # link_T_segment, from the segment inwards
    index = body.segment_joint[segment]
    while index >= 0:
        joint = body.joints[index]
        hinges.insert(0, _Hinge(index, rotation.T @ joint.axis, -rotation.T @ translation))
        rotation, translation = joint.rotation @ rotation, joint.translation + joint.rotation @ translation
        index = joint.parent
        if index >= 0 and body.joints[index].segment != NO_SEGMENT:
            return Branch(segment, body.joints[index].segment, rotation, translation, tuple(hinges))
    on_root = body.n_root and segment != 0
    return Branch(segment, 0 if on_root else WORLD, rotation, translation, tuple(hinges))


def row(values: Iterable[float] | Array) -> str:
    """Return numbers separated by blanks, each with all its digits."""
    return " ".join(repr(float(v) + 0.0) for v in np.ravel(np.asarray(values, dtype=float)))


def plain_name(name: str) -> str:
    """Return a name without blanks and signs that OpenSim and biorbd refuse in names."""
    return re.sub(r"[^\w.-]", "_", name) or "model"


def link_names(body: Body) -> list[str]:
    """Return the name of what turns with each joint (n): its segment, or an intermediate link named after the joint."""
    return [body.segments[joint.segment] if joint.segment >= 0 else f"{joint.name}_link" for joint in body.joints]


def add(parent: Element, tag: str, text: str = "", **attributes: str) -> Element:
    """Append an element with text and attributes and return it."""
    element = SubElement(parent, tag, attributes)
    element.text = text or None
    return element


def xml_document(root: Element, source: str) -> str:
    """Return the file's text; ``source`` becomes a comment under the root element."""
    if source:
        root.insert(0, Comment(f" {source.replace('--', '- -')} "))
    indent(root, space="  ")
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + tostring(root, encoding="unicode") + "\n"


def six(inertia: Array) -> str:
    """Return xx yy zz xy xz yz of a tensor (3, 3): the order of MJCF's fullinertia and of .osim."""
    return row(inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]])
