"""What a Body is made of: joints and their tree, marker places, limits and soles; the constants of its frames; lumps of
mass and their ten parameters about a joint.

Pseudo-inertia (Wensing, Kim and Slotine 2018, doi:10.1109/LRA.2017.2729659): P = [[0.5 tr(I) 1 - I, m c], [m c', m]]
about the joint; a lump is made of real (positive) mass if and only if P is positive semi-definite.
"""

from dataclasses import dataclass, fields
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np

from biodance.errors import BiodanceError, known_index
from biodance.records import Array, freeze
from biodance.settings import STANDARD_GRAVITY

NO_SEGMENT = -1
_NO_JOINT = -1
UPRIGHT = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""(3, 3) lab_R_segment of a neutral upright body facing lab x: x -> lab x, y (up) -> lab z, z (right) -> lab -y."""
GRAVITY = np.array([0.0, 0.0, -STANDARD_GRAVITY])
"""(3,) m/s², lab frame, z up: where no body says otherwise (`Body.gravity`)."""


@dataclass(frozen=True, eq=False)
class Joint:
    """One revolute degree of freedom.

    ``parent`` index of the parent joint in ``Body.joints`` (-1: the root); ``axis`` (3,) unit vector in the joint's
    frame, signed so that the positive angle is the anatomical direction in ``positive``; ``rotation`` (3, 3) and
    ``translation`` (3,) m place the joint frame in the parent joint's frame at zero angle; ``segment`` index in
    ``Body.links`` of the segment or part that turns with this joint, -1 for an intermediate link.
    """

    name: str
    parent: int
    axis: Array
    rotation: Array
    translation: Array
    segment: int = NO_SEGMENT
    positive: str = ""

    def __post_init__(self) -> None:
        freeze(self, f"joint {self.name}", axis=(3,), rotation=(3, 3), translation=(3,))
        if abs(np.linalg.norm(self.axis) - 1) > 1e-9:
            raise BiodanceError(f"Joint {self.name}: axis {self.axis} is not a unit vector.")


@dataclass(frozen=True, eq=False)
class Part:
    """A piece of a segment that moves on joints of its own: a head on the trunk, a hand on the forearm.

    ``segment`` index of the segment that it is a piece of, whose inertial parameters go on meaning the whole, in the
    neutral posture; ``share`` (10,) the ten parameters of the piece, in its own frame (axes of the segment, origin at
    its joint), for one kilogram of the whole: the piece has its share of the mass, and whatever else of the whole
    differs from the table is in the rest. Where the ``rest_moves``, the greater piece is the one that moves (a thorax
    on the loins): ``share`` is then of what stays, in the segment's frame.
    """

    name: str
    segment: int
    share: Array
    rest_moves: bool = False

    def __post_init__(self) -> None:
        freeze(self, f"part {self.name}", share=(10,))


@dataclass(frozen=True, eq=False)
class SegmentMarkers:
    """Where each marker sits: ``names`` (K), ``segment`` (K,) index in ``Body.links``, ``position`` (K, 3) m in the
    frame of that segment or part, ``weight`` (K,) >= 0.
    """

    names: tuple[str, ...]
    segment: tuple[int, ...]
    position: Array
    weight: Array

    def __post_init__(self) -> None:
        count = len(self.names)
        freeze(self, "SegmentMarkers", position=(count, 3), weight=(count,))
        if len(self.segment) != count:
            raise BiodanceError(f"SegmentMarkers: {count} names but {len(self.segment)} segment indices.")


class JointError(NamedTuple):
    """How far the anatomical ``joint`` of a body may be from the person's, standard deviations: ``centre`` m per axis,
    ``axis`` rad of a hinge's flexion axis (0 for other joints); ``contradicted`` where the movement contradicts the
    place that the static trial gave the joint, which was ``moved`` so many m from there; ``spared`` the marker beside
    it that seems to have moved since the static trial and did not count in placing it (``moved`` is then how far the
    joint would lie with it), "" for none. Of a contradicted one ``reach`` m, how far it lies from there if it may be as
    far off as joints are that are wrong, and its standard deviation ``reach_sd`` (0: not told).
    """

    joint: str
    centre: float
    axis: float
    contradicted: bool = False
    moved: float = 0.0
    spared: str = ""
    reach: float = 0.0
    reach_sd: float = 0.0


@dataclass(frozen=True, eq=False)
class JointLimits:
    """Per joint (n,), along its positive sense: ``lower``, ``upper`` rad; ``velocity`` rad/s > 0;
    ``torque_lower`` <= 0 <= ``torque_upper`` N·m.
    """

    lower: Array
    upper: Array
    velocity: Array
    torque_lower: Array
    torque_upper: Array

    def __post_init__(self) -> None:
        count = np.size(self.lower)
        freeze(self, "JointLimits", **{field.name: (count,) for field in fields(self)})
        if np.any(self.lower > self.upper):
            raise BiodanceError(f"JointLimits: lower > upper at joint {int(np.argmax(self.lower > self.upper))}.")


@dataclass(frozen=True, eq=False)
class Foot:
    """The sole: ``segment`` index of the foot, ``outline`` (P, 3) m in its frame, counter-clockwise from above."""

    segment: int
    outline: Array

    def __post_init__(self) -> None:
        freeze(self, "Foot", outline=(None, 3))


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
        return tuple(carried.get(i, _NO_JOINT) for i in range(len(self.segments) + len(self.parts)))

    @cached_property
    def paths(self) -> tuple[tuple[int, ...], ...]:
        """Of every joint the indices of the joints from the root to it, itself last."""
        paths: list[tuple[int, ...]] = []
        for index, joint in enumerate(self.joints):
            paths.append((*(paths[joint.parent] if joint.parent >= 0 else ()), index))
        return tuple(paths)

    def path_to(self, link: int) -> tuple[int, ...]:
        """Return the joints between the root and a segment or part.

        Parameters
        ----------
        link : int
            Index in ``links``.

        Returns
        -------
        tuple of int
            Indices in ``joints`` from the root outwards, the joint that carries the link last; empty for the root's
            segment.

        Examples
        --------
        >>> len(result.body.path_to(result.body.segment_index("right_foot")))
        6
        """
        carrier = self.segment_joint[link]
        return self.paths[carrier] if carrier != _NO_JOINT else ()

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
        # Links = table times segments: the part has its share of the mass, and its matter is taken from the rest; a
        # rest that moves goes where the part is, when all others are taken from it.
        for k, part in sorted(enumerate(self.parts), key=lambda pair: pair[1].rest_moves):
            mass, rest = 10 * part.segment, slice(10 * part.segment, 10 * part.segment + 10)
            own, origin = self.part_place(k)
            if part.rest_moves:
                table[rest, mass] -= part.share
                table[own] = shift_matter(-origin) @ table[rest]
                table[rest] = 0.0
                table[rest, mass] = part.share
            else:
                table[own, mass] = part.share
                table[rest, mass] -= shift_matter(origin) @ part.share
        return table

    def part_place(self, k: int) -> tuple[slice, Array]:
        """Return where a part stands.

        Parameters
        ----------
        k : int
            Index in ``parts``.

        Returns
        -------
        tuple
            Slice of its ten parameters among those of the ``links``, and the place (3,) m of its joint in the frame of
            its segment.

        Examples
        --------
        >>> [result.body.part_place(k) for k in range(len(result.body.parts))]
        []
        """
        link = len(self.segments) + k
        return slice(10 * link, 10 * link + 10), self.place_on_segment(self.segment_joint[link])[1]

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
        return known_index("joint", name, [joint.name for joint in self.joints])

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
        return known_index("segment", name, self.segments)


TENSOR = ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2))
"""Row and column of Ixx, Ixy, Iyy, Ixz, Iyz, Izz in Pinocchio's order of the ten parameters."""


@dataclass(frozen=True, eq=False)
class RigidInertia:
    """A rigid lump: ``mass`` kg, ``com`` (3,) m in some frame, ``inertia`` (3, 3) kg·m² about the CoM in its axes."""

    mass: float
    com: Array
    inertia: Array


def combine_inertias(*lumps: RigidInertia) -> RigidInertia:
    """Return several lumps given in one frame as one rigid lump."""
    mass = sum(lump.mass for lump in lumps)
    com = sum((lump.mass * lump.com for lump in lumps), np.zeros(3)) / mass
    # Parallel axes to the common CoM.
    inertia = sum((lump.inertia + lump.mass * _steiner(lump.com - com) for lump in lumps), np.zeros((3, 3)))
    return RigidInertia(mass, com, inertia)


def _steiner(arm: Array) -> Array:
    """Return the inertia (3, 3) m² of a unit point mass at ``arm`` (3,) m about the origin."""
    return float(arm @ arm) * np.eye(3) - np.outer(arm, arm)


def stretch_inertia(lump: RigidInertia, times: Array) -> RigidInertia:
    """Return the lump with its matter stretched by ``times`` (3,) along the axes of its frame, from the origin."""
    # Central second moments S = tr(I)/2 1 - I become D S D; the mass is the same.
    moments = times[:, None] * (0.5 * np.trace(lump.inertia) * np.eye(3) - lump.inertia) * times
    return RigidInertia(lump.mass, times * lump.com, np.trace(moments) * np.eye(3) - moments)


def inertial_parameters(lump: RigidInertia) -> Array:
    """Return [m, mc, Ixx, Ixy, Iyy, Ixz, Iyz, Izz] (10,), inertia about the origin of the lump's frame."""
    about_origin = lump.inertia + lump.mass * _steiner(lump.com)
    return np.array([lump.mass, *(lump.mass * lump.com), *(about_origin[i, j] for i, j in TENSOR)])


def rigid_inertia(phi: Array) -> RigidInertia:
    """Return the lump of ten parameters; the inverse of `inertial_parameters` for a positive mass."""
    com = phi[1:4] / phi[0]
    return RigidInertia(float(phi[0]), com, inertia_tensor(phi[4:]) - phi[0] * _steiner(com))


def inertia_tensor(moments: Array) -> Array:
    """Return the tensor (3, 3) of Ixx, Ixy, Iyy, Ixz, Iyz, Izz (6,)."""
    xx, xy, yy, xz, yz, zz = moments
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _pseudo_inertia_map() -> Array:
    """Return M (16, 10) with ``J = (M @ phi).reshape(4, 4)``."""
    M = np.zeros((4, 4, 10))
    M[3, 3, 0] = 1.0
    for axis in range(3):
        M[axis, 3, 1 + axis] = M[3, axis, 1 + axis] = 1.0
    for column, (i, j) in enumerate(TENSOR, start=4):
        if i == j:
            for axis in range(3):
                # tr(I)/2 1 - I: the moment I_ii counts + 1/2 on the other two axes, - 1/2 on its own.
                M[axis, axis, column] += 0.5 if axis != i else -0.5
        else:
            M[i, j, column] = M[j, i, column] = -1.0
    return M.reshape(16, 10)


PSEUDO_INERTIA = _pseudo_inertia_map()
"""(16, 10): the pseudo-inertia is linear in the ten parameters."""


def shift_matter(shift: Array, turn: Array | None = None) -> Array:
    """Return the map (10, 10) of the ten parameters when all matter is turned by ``turn`` (3, 3) about the origin of
    the segment's frame, if given, and moves by ``shift`` (3,) m in it.
    """
    move = np.eye(4)
    move[:3, :3], move[:3, 3] = np.eye(3) if turn is None else turn, shift
    # J' = M J M' with the homogeneous move M: (M kron M) on the 16 elements, back to ten parameters.
    return np.asarray(np.linalg.lstsq(PSEUDO_INERTIA, np.kron(move, move) @ PSEUDO_INERTIA, rcond=None)[0])


def pseudo_inertia(phi: Array) -> Array:
    """Return the pseudo-inertias (N, 4, 4) of ``phi`` (10N,): second moments kg·m², first moments kg·m, mass kg."""
    return (phi.reshape(-1, 10) @ PSEUDO_INERTIA.T).reshape(-1, 4, 4)


def smallest_eigenvalues(phi: Array) -> Array:
    """Return the smallest eigenvalue (N,) of every segment's pseudo-inertia; negative: no such body can exist."""
    return np.asarray(np.linalg.eigvalsh(pseudo_inertia(phi))[:, 0])


def turn_inertia(lump: RigidInertia, rotation: Array) -> RigidInertia:
    """Return the lump in another frame with the same origin: ``rotation`` (3, 3) is new_R_old, or a reflection."""
    return RigidInertia(lump.mass, rotation @ lump.com, rotation @ lump.inertia @ rotation.T)


def parameter_jacobian(lump: RigidInertia) -> Array:
    """Return d phi / d [m, c, Jxx, Jxy, Jyy, Jxz, Jyz, Jzz] (10, 10) at a lump."""
    mass, com = lump.mass, lump.com
    out = np.zeros((10, 10))
    # At constant c and J per mass all ten are in proportion to the mass.
    out[:, 0] = inertial_parameters(lump) / mass
    out[1:4, 1:4] = mass * np.eye(3)
    for row, (i, j) in enumerate(TENSOR, start=4):
        for k in range(3):
            # d(|c|² 1 - c c')_ij / dc_k.
            shift = 2 * com[k] * (i == j) - com[i] * (j == k) - com[j] * (i == k)
            out[row, 1 + k] = mass * shift
    out[4:, 4:] = mass * np.eye(6)
    return out


def lump_from(row: Array) -> RigidInertia:
    """Return the segment of [m, c, Jxx, Jxy, Jyy, Jxz, Jyz, Jzz]; the inverse of `primitives_of`."""
    return RigidInertia(float(row[0]), row[1:4], row[0] * inertia_tensor(row[4:]))
