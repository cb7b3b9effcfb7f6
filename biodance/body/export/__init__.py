"""FAMILY: one model format per file, found automatically; other packages join by the entry points ``biodance.exports``.
What XML formats share stands here, too: a body as a tree of segments on compound joints, numbers without loss.

A member is a module or object of the form `ModelFormat`; it writes the joints of the body, its inertial parameters and,
where the format knows them, markers, limits and boxes. All lengths in m, angles in rad, masses in kg.
"""

import inspect
import re
import warnings
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol
from xml.etree.ElementTree import Comment, Element, SubElement, indent, tostring

import numpy as np
from scipy.spatial.transform import Rotation

from biodance.body.body import Body
from biodance.body.changes import parts_as_segments
from biodance.body.parts import NO_SEGMENT, pseudo_inertia
from biodance.body.solids import SegmentSolids
from biodance.discovery import Family, missing_of
from biodance.errors import BiodanceError
from biodance.lab.plain_text import refuse_present, write_whole
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
        # Axis and a point on it in the child's frame at zero angles: R'a, -R'p.
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


def euler_angles(order: str, rotation: Array) -> Array:
    """Return (3,) rad about the axes in ``order``, as scipy writes it: "XYZ" for R = Rx Ry Rz (an OpenSim frame), "xyz"
    for R = Rz Ry Rx (roll, pitch, yaw); the last one is zero where the middle one is +-90 degrees.
    """
    with warnings.catch_warnings(action="ignore"):  # of that posture, in which two of them are one turn
        return np.asarray(Rotation.from_matrix(rotation).as_euler(order))


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


class ModelFormat(Protocol):
    """One format of models: a module, a class or an object."""

    FORMAT: str
    """Its name on the command line."""
    SUFFIX: str
    """The usual suffix of its files, with the dot."""

    def text(self, body: Body, source: str) -> str:
        """Return the whole file; ``source`` is one line that says where the parameters come from.

        A binary format has ``data(body, source)``, which returns bytes, instead. A format that shows the shapes of
        segments takes ``solids`` as a third argument, a closed mesh by segment; if it keeps them in files of their own,
        ``beside(body, solids)`` returns those by their path beside the file.
        """


def _lacking(member: object) -> tuple[str, ...]:
    """Return what a model format lacks; ``data`` serves instead of ``text``."""
    missing = missing_of(ModelFormat)(member)
    return tuple(name for name in missing if name != "text" or not hasattr(member, "data"))


FAMILY: Family[ModelFormat] = Family("model format", "biodance.exports", __name__, "", _lacking, lambda one: one.FORMAT)


def formats() -> Mapping[str, ModelFormat]:
    """Return the formats by name."""
    return FAMILY.choose(None)


def refuse_impossible(body: Body) -> None:
    """Raise BiodanceError if a segment's parameters belong to no mass distribution (pseudo-inertia, mass)."""
    for name in body.segments:
        phi = body.sip.of(name)
        if not np.isfinite(phi).all():
            raise BiodanceError(
                f"Segment {name}: an inertial parameter is not a number, so no model can be written. Identify again."
            )
        if phi[0] <= 0:
            raise BiodanceError(
                f"Segment {name}: a mass of {phi[0]:g} kg cannot exist, so no model is written. Masses must be "
                "positive."
            )
        value = np.linalg.eigvalsh(pseudo_inertia(phi)[0])
        # by so small a share of the largest, the smallest may be negative from rounding alone
        if value[0] < -1e-9 * value[-1]:
            raise BiodanceError(
                f"Segment {name}: no body has this mass, centre and inertia (pseudo-inertia eigenvalue {value[0]:.3g}, "
                "must be >= 0), so no model is written. Use physically consistent parameters."
            )


def write_model(
    body: Body, path: str | Path, *, format: str | ModelFormat, source: str = "", solids: SegmentSolids | None = None
) -> Path:
    """Write ``body`` as a model file and return the path; ``format`` is the name of one, or an object that writes it.

    ``solids`` a closed mesh by segment (m, in its axes) for the formats that show shapes (osim, glb).

    Raises
    ------
    UnknownName
        There is no such format.
    BiodanceError
        The inertia of a segment cannot exist, or the format cannot hold the joints or the solids of this body.
    FileRefused
        The file, or one that belongs beside it, exists (nothing is overwritten), or cannot be written.
    """
    path = Path(path)
    (kind,) = (FAMILY.choose([format]) if isinstance(format, str) else FAMILY.judged([format])).values()
    refuse_impossible(body)
    if kind.FORMAT != "csv":  # it says what is known of the segments as wholes; others show the parts as bodies
        body = parts_as_segments(body)
        refuse_impossible(body)
    write: Callable[..., str | bytes] = getattr(kind, "data", None) or kind.text
    if solids is not None and "solids" not in inspect.signature(write).parameters:
        raise BiodanceError(f"The format {kind.FORMAT} shows no meshes. Leave them out, or choose glb or osim.")
    content = write(body, source) if solids is None else write(body, source, solids)
    beside = kind.beside(body, solids) if solids is not None and hasattr(kind, "beside") else {}
    new = {path.parent / name: data for name, data in beside.items()}
    new = {file: data for file, data in new.items() if not (file.is_file() and file.read_bytes() == data)}
    for file in (path, *new):
        refuse_present(file)
    for file, data in new.items():
        file.parent.mkdir(exist_ok=True)
        write_whole(file, data)
    content = content if isinstance(content, bytes) else str(content).encode()
    return write_whole(path, content)  # last: a model that is there has all that it names
