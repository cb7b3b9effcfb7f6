"""A tree of joints: which segment hangs on which, under which index."""

from functools import cached_property
from typing import Literal

import numpy as np

from biodance.body.inertia import shift_matter
from biodance.body.parts import NO_JOINT, NO_SEGMENT, Joint, Part
from biodance.errors import UnknownName
from biodance.records import Array


class JointTree:
    """What a body's segments, joints and parts say about their order; the base of `Body`, which holds them."""

    segments: tuple[str, ...]
    joints: tuple[Joint, ...]
    root: Literal["free_flyer", "fixed"]
    parts: tuple[Part, ...]

    @property
    def n_root(self) -> int:
        """Velocity coordinates of the root: 6 or 0."""
        return 6 if self.root == "free_flyer" else 0

    @property
    def nq(self) -> int:
        """Number of position coordinates."""
        return len(self.joints) + (7 if self.n_root else 0)

    @property
    def nv(self) -> int:
        """Number of velocity coordinates."""
        return len(self.joints) + self.n_root

    @property
    def links(self) -> tuple[str, ...]:
        """Names of the N segments and, behind them, of the P parts."""
        return (*self.segments, *(part.name for part in self.parts))

    @cached_property
    def segment_joint(self) -> tuple[int, ...]:
        """Index in `joints` of the joint that carries each of the `links`, (N + P); -1 for the root's segment."""
        carried = {joint.segment: i for i, joint in enumerate(self.joints) if joint.segment != NO_SEGMENT}
        return tuple(carried.get(i, NO_JOINT) for i in range(len(self.segments) + len(self.parts)))

    def place_on_segment(self, joint: int) -> tuple[int, Array]:
        """Return which segment a joint hangs on, and where.

        Parameters
        ----------
        joint : int
            Index in ``joints``.

        Returns
        -------
        tuple
            Index of the segment, parts passed over, and the joint's place (3,) m in its frame in the neutral posture.

        Examples
        --------
        >>> result.body.place_on_segment(result.body.joint_index("right_hip_flexion"))[0]
        0
        """
        place, above = self.joints[joint].translation, self.joints[joint].parent
        while above >= 0 and not 0 <= self.joints[above].segment < len(self.segments):
            place = self.joints[above].translation + self.joints[above].rotation @ place
            above = self.joints[above].parent
        return (self.joints[above].segment if above >= 0 else 0), place

    @cached_property
    def sharing(self) -> Array | None:
        """(10 (N + P), 10 N): the parameters of the `links` from those of the segments, each of which means the whole;
        None without parts.
        """
        if not self.parts:
            return None
        count = 10 * len(self.segments)
        table = np.eye(count + 10 * len(self.parts), count)
        for k, part in enumerate(self.parts):
            mass, rest = 10 * part.segment, slice(10 * part.segment, 10 * part.segment + 10)
            table[count + 10 * k : count + 10 * k + 10, mass] = part.share
            _, origin = self.place_on_segment(self.segment_joint[len(self.segments) + k])
            table[rest, mass] -= shift_matter(origin) @ part.share
        return table

    def joint_index(self, name: str) -> int:
        """Return the index of a joint in ``joints``.

        Parameters
        ----------
        name : str
            Of a joint angle, as ``left_knee_flexion``.

        Returns
        -------
        int
            Its column is 7 + index in q and 6 + index in v for a free-flyer root.

        Raises
        ------
        UnknownName
            There is no such joint; the legal names are listed.

        Examples
        --------
        >>> result.body.joint_index("right_hip_flexion")
        0
        """
        names = tuple(joint.name for joint in self.joints)
        if name not in names:
            raise UnknownName.of("joint", name, names)
        return names.index(name)

    def segment_index(self, name: str) -> int:
        """Return the index of a segment by name.

        Parameters
        ----------
        name : str
            Of a segment, as ``left_thigh``.

        Returns
        -------
        int
            Its row in every table of segments.

        Raises
        ------
        UnknownName
            There is no such segment; the legal names are listed.

        Examples
        --------
        >>> result.body.segment_index("pelvis")
        0
        """
        if name not in self.segments:
            raise UnknownName.of("segment", name, self.segments)
        return self.segments.index(name)
