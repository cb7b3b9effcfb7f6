"""The Body record: a tree of rigid segments on one-degree-of-freedom joints, with markers, prior SIP, limits and boxes.

Segment frames follow ISB: x anterior, y up, z right (in the upright neutral posture), origin at the proximal joint
centre; they are the joint frames in which the SIP are written. The lab frame has z up, so the neutral root is rotated
by +90 deg about x. A joint with several degrees of freedom is a chain of one-dof joints whose intermediate links carry
no segment.
"""

import json
from collections.abc import Collection, Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from biodance import display
from biodance.body.parts import GRAVITY, Foot, Joint, JointError, JointLimits, JointTree, Part, SegmentMarkers
from biodance.errors import BiodanceError, FileRefused, MissingLibrary
from biodance.library import parse_json, refuse_special
from biodance.records import Array, Sip, freeze
from biodance.threads import Sendable

if TYPE_CHECKING:
    import pandas as pd
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


@dataclass(frozen=True, eq=False)
class Body(JointTree, Sendable):
    """A person or robot as a tree of rigid segments.

    Parameters
    ----------
    name : str
        Of the person or robot.
    segments : tuple of str
        (N) names; the first is the root's.
    joints : tuple
        (n) joints of one degree of freedom, in topological order = Pinocchio's order.
    sip : Sip
        What is known of the inertial parameters, with covariance.
    limits : JointLimits
        Per joint: range rad, speed rad/s, torque N·m.
    markers : SegmentMarkers
        Where each marker sits: segment, position m in its frame, weight.
    boxes : array_like
        (N, 2, 3) m, lower and upper corner of the segment's shape box in its frame.
    com_boxes : array_like
        (N, 2, 3) m, where the centre of mass may be.
    feet : dict
        Soles by side ("left", "right").
    root : {"free_flyer", "fixed"}
        Free: nq = 7 + n, nv = 6 + n; fixed: nq = nv = n, the root joint carries no segment.
    notes : tuple of str
        How the body was made: table, scaling, warnings.
    joint_errors : tuple
        Of the joints that a movement placed; none of those that only landmarks did.
    gravity : array_like
        (3,) m/s², lab frame, where it moves, as a pinocchio model has it.
    at_joint : Sip, optional
        The same table with the trunk's matter along with its joint, which movement may put elsewhere than the table
        cuts the trunk from the pelvis; None where both are one.
    girths : mapping
        By segment, what of the person's shape its mass in ``sip`` takes in beside the table: girths by name, "foot
        outline", "scan".
    parts : tuple
        Pieces of segments that move on joints of their own (``Part``): the head, hands, collar bones.

    Examples
    --------
    >>> result.body
    Body('visit', 12 segments, 23 joint angles, 61.9 kg)
    """

    name: str
    segments: tuple[str, ...]
    joints: tuple[Joint, ...]
    sip: Sip
    limits: JointLimits
    markers: SegmentMarkers
    boxes: Array
    com_boxes: Array
    feet: dict[str, Foot] = field(default_factory=dict)
    root: Literal["free_flyer", "fixed"] = "free_flyer"
    notes: tuple[str, ...] = ()
    joint_errors: tuple[JointError, ...] = ()
    gravity: Array = field(default_factory=GRAVITY.copy)
    at_joint: Sip | None = None
    girths: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    parts: tuple[Part, ...] = ()

    def __post_init__(self) -> None:
        count = len(self.segments)
        freeze(self, self.name, boxes=(count, 2, 3), gravity=(3,), com_boxes=(count, 2, 3))
        if self.sip.segments != self.segments:
            raise BiodanceError(
                f"{self.name}: the SIP name other segments ({self.sip.segments}) than the body ({self.segments})."
            )
        if len(self.limits.lower) != len(self.joints):
            raise BiodanceError(f"{self.name}: {len(self.joints)} joints but limits for {len(self.limits.lower)}.")
        if any(joint.parent >= i for i, joint in enumerate(self.joints)):
            raise BiodanceError(f"{self.name}: a joint comes before its parent.")

    def __repr__(self) -> str:
        return (
            f"Body({self.name!r}, {len(self.segments)} segments, {len(self.joints)} joint angles, "
            f"{self.sip.mass.sum():.1f} kg)"
        )

    def _repr_html_(self) -> str:
        return display.card(repr(self), self.table(), self.notes)

    def table(self) -> "pd.DataFrame":
        """Return one row for each segment, with the parameters known beforehand.

        Returns
        -------
        pandas.DataFrame
            Index segment; as `Sip.table`, and ``box x (m)`` ..., the size of the segment's shape box.

        Examples
        --------
        >>> bool(result.body.table().loc["left_thigh", "box y (m)"] > 0.3)
        True
        """
        out = self.sip.table()
        for k, axis in enumerate("xyz"):
            out[f"box {axis} (m)"] = self.boxes[:, 1, k] - self.boxes[:, 0, k]
        return out

    @property
    def free(self) -> NDArray[np.bool_]:
        """(n) True for the joints that can move; a held one has a range of width zero."""
        return np.asarray(self.limits.lower < self.limits.upper)

    def holding(self, names: Collection[str], q: Array) -> "Body":
        """Return the body with some joints held: what hangs on them is carried as one piece.

        Parameters
        ----------
        names : collection of str
            Joints (``trunk_flexion``) or whole anatomical ones (``right_shoulder``).
        q : array_like
            (nq,) posture at whose angles they are held.

        Returns
        -------
        Body
            In which the range of these joints has width zero.

        Examples
        --------
        >>> int(result.body.holding({"trunk"}, result.body.neutral).free.sum())
        20
        """
        wanted = {*names}
        held = np.array([bool({j.name, j.name.rsplit("_", 1)[0]} & wanted) for j in self.joints], dtype=bool)
        angle = np.asarray(q)[self.nq - len(self.joints) :]
        lower, upper = (np.where(held, angle, limit) for limit in (self.limits.lower, self.limits.upper))
        return replace(self, limits=replace(self.limits, lower=lower, upper=upper))

    def link_parameters(self, phi: Array | None = None) -> Array:
        """Return the inertial parameters of segments without their parts, and of the parts.

        Parameters
        ----------
        phi : numpy.ndarray, optional
            (10 N,) of the segments, each with its parts; by default the body's.

        Returns
        -------
        numpy.ndarray
            (10 (N + P),) of the `links`.

        Examples
        --------
        >>> result.body.link_parameters().shape
        (120,)
        """
        whole = self.sip.phi if phi is None else phi
        return whole if self.sharing is None else self.sharing @ whole

    @property
    def neutral(self) -> Array:
        """Upright posture, (nq,): zero joint angles, root at the lab origin, facing lab x."""
        q = np.zeros(self.nq)
        if self.n_root:
            # A quarter turn about x: quaternion (sin 45°, 0, 0, cos 45°) in the order x, y, z, w.
            q[3:7] = np.array([1.0, 0.0, 0.0, 1.0]) / np.sqrt(2.0)
        return q

    @cached_property
    def model(self) -> "pin.Model":
        """Its pinocchio model; never written to. Joint ids are 2 + index in `joints` (1 + index for a fixed root)."""
        pin, limits, one = load_pinocchio(), self.limits, np.ones(1)
        model = pin.Model()
        model.name = self.name
        model.gravity.linear = np.array(self.gravity)
        free, still = pin.JointModelFreeFlyer(), pin.SE3.Identity()
        root = model.addJoint(0, free, still, "root") if self.n_root else 0
        ids: list[int] = []
        for i, joint in enumerate(self.joints):
            parent = root if joint.parent < 0 else ids[joint.parent]
            turning = pin.JointModelRevoluteUnaligned(np.array(joint.axis))
            placement = pin.SE3(np.array(joint.rotation), np.array(joint.translation))
            effort = max(-limits.torque_lower[i], limits.torque_upper[i])
            bounds = [value * one for value in (effort, limits.velocity[i], limits.lower[i], limits.upper[i])]
            ids.append(model.addJoint(parent, turning, placement, joint.name, *bounds))
        for carrier, parameters in zip(self.segment_joint, self.link_parameters().reshape(-1, 10), strict=True):
            # The ten parameters are about the joint, as Pinocchio's dynamic parameters are.
            inertia = pin.Inertia.FromDynamicParameters(np.array(parameters))
            model.appendBodyToJoint(root if carrier < 0 else ids[carrier], inertia, still)
        return model


_VERSION = 1
_HEAVIEST = 1000.0  # kg of a whole body: people, and robots that stand on force plates
_FARTHEST = 10.0  # m of a place in a segment, or of a joint from its parent


def body_text(body: Body, source: str) -> str:
    """Return the file's text; ``source`` says in a sentence where the parameters come from."""
    return json.dumps({"biodance_body": _VERSION, "source": source, **asdict(body)}, default=np.ndarray.tolist) + "\n"


def read_body(path: str | Path) -> tuple[Body, str]:
    """Return the body of a file that ``body_text`` made, and its source.

    Raises
    ------
    FileRefused
        The file cannot be read, is of another version, or is not such a file.
    """
    refuse_special(Path(path))
    try:
        text = Path(path).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise FileRefused(f"{path}: cannot be read ({getattr(error, 'strerror', None) or error}).") from error
    return parse_body(text, str(path))


def parse_body(text: str, where: str) -> tuple[Body, str]:
    """Return the body and its source from the ``text`` of `body_text`; ``where`` it was found, for messages.

    Raises
    ------
    FileRefused
        The text is of another version or is not such a body.
    """
    try:
        raw: dict[str, Any] = parse_json(text)
        if raw.get("biodance_body") != _VERSION:
            raise FileRefused(f"{where}: is no body of version {_VERSION}. Run biodance identify again.")
        return _possible(_body(raw)), str(raw["source"])
    except FileRefused:
        raise
    except (ValueError, KeyError, TypeError, AttributeError, BiodanceError) as error:
        raise FileRefused(
            f"{where}: is not a body that biodance wrote ({error}). Run biodance identify again."
        ) from error


def _body(raw: dict[str, Any]) -> Body:
    worn = raw["markers"]
    place = np.reshape(worn["position"], (-1, 3))  # a robot may have none
    return Body(
        name=raw["name"],
        segments=tuple(raw["segments"]),
        joints=tuple(Joint(**joint) for joint in raw["joints"]),
        sip=Sip(**raw["sip"]),
        limits=JointLimits(**raw["limits"]),
        markers=SegmentMarkers(tuple(worn["names"]), tuple(worn["segment"]), place, np.array(worn["weight"])),
        boxes=raw["boxes"],
        com_boxes=raw["com_boxes"],
        feet={side: Foot(**foot) for side, foot in raw["feet"].items()},
        root=raw["root"],
        notes=tuple(raw["notes"]),
        joint_errors=tuple(JointError(*error) for error in raw["joint_errors"]),
        **({"gravity": raw["gravity"]} if "gravity" in raw else {}),
        at_joint=Sip(**raw["at_joint"]) if raw.get("at_joint") else None,
        girths={segment: tuple(names) for segment, names in raw.get("girths", {}).items()},
        parts=tuple(Part(**part) for part in raw.get("parts", ())),
    )


def _possible(body: Body) -> Body:
    """Return the body."""
    sip = body.sip
    places = {
        "centre of mass": sip.com,
        "place of a joint": np.array([joint.translation for joint in body.joints]),
        "place of a marker": body.markers.position,
    }
    for what, array in {"parameters": sip.phi, "covariance of the parameters": sip.covariance, **places}.items():
        if not np.isfinite(array).all():
            raise ValueError(f"{what}: {np.ravel(array)[~np.isfinite(np.ravel(array))][0]} is no number")
    for what, array in places.items():
        if np.abs(array).max(initial=0.0) > _FARTHEST:
            raise ValueError(f"{what}: {np.abs(array).max():.3g} m; legal are up to {_FARTHEST:g} m")
    if not np.allclose(sip.covariance, sip.covariance.T, rtol=1e-6, atol=1e-15):
        raise ValueError("covariance of the parameters: what two have in common stands there twice, and differs")
    worst, whole = float(sip.mass.min()), float(sip.mass.sum())
    if worst < 0 or not 0 < whole <= _HEAVIEST:
        raise ValueError(
            f"mass: {whole:.3g} kg in all, least {worst:.3g}; legal are up to {_HEAVIEST:g} kg, none below 0"
        )
    return body
