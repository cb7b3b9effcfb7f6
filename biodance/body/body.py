"""The Body record: a tree of rigid segments on one-degree-of-freedom joints, with markers, prior SIP, limits and boxes.

Segment frames follow ISB: x anterior, y up, z right (in the upright neutral posture), origin at the proximal joint
centre; they are the joint frames in which the SIP are written. The lab frame has z up, so the neutral root is rotated
by +90 deg about x. A joint with several degrees of freedom is a chain of one-dof joints whose intermediate links carry
no segment.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from biodance import display
from biodance.body.parts import GRAVITY, Foot, Joint, JointError, JointLimits, JointTree, Part, SegmentMarkers
from biodance.body.pinocchio_model import build
from biodance.errors import BiodanceError
from biodance.records import Array, Sip, freeze
from biodance.threads import Sendable

if TYPE_CHECKING:
    import pandas as pd
    import pinocchio as pin


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
            q[3:7] = np.array([1.0, 0.0, 0.0, 1.0]) / np.sqrt(2.0)
        return q

    @cached_property
    def model(self) -> "pin.Model":
        """Its pinocchio model; never written to. Joint ids are 2 + index in `joints` (1 + index for a fixed root)."""
        return build(
            self.name,
            self.joints,
            self.limits,
            inertias=tuple(zip(self.segment_joint, self.link_parameters().reshape(-1, 10), strict=True)),
            gravity=self.gravity,
            free=bool(self.n_root),
        )
