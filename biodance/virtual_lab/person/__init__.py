"""A virtual person: the true body, its masses drawn around a population mean (``anthropometry/virtual/people.toml``),
its habits, the loads it carries, and a prosthesis in place of a part of a limb.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np

from biodance.body.body import Body
from biodance.body.parts import Foot, JointLimits
from biodance.errors import BiodanceError, UnknownName, refuse_unknown
from biodance.motion.kinematics import poses
from biodance.records import SIDES, Array, Sip, Subject, freeze
from biodance.virtual_lab.movement import STAND
from biodance.virtual_lab.person import skeleton

_POPULATION = 0.08
"""Relative standard deviation of what the people of one place have in common beside the tables' midpoint: as published
tables differ among themselves (de Leva 1996, Dumas 2018, Zatsiorsky)."""


def true_pseudo_inertia(mass: float, com: Array, radii: Array) -> Array:
    """Return the pseudo-inertia (4, 4) of ``mass`` kg with CoM (3,) m and radii of gyration (3,) m about the frame's
    axes at the CoM: J = [[S, h], [h', m]] with S second moment, h first moment, m mass. Possible bodies have J >= 0,
    and a linear map of the points, A J A', keeps it so.
    """
    gyration = np.asarray(radii, float) ** 2
    # k_x² = mean of y² + z²: the mean of x² is (k_x² + k_y² + k_z²) / 2 - k_x².
    second = np.diag(0.5 * gyration.sum() - gyration)
    out = np.empty((4, 4))
    # Parallel axes: second moments about the origin.
    out[:3, :3] = mass * (second + np.outer(com, com))
    out[:3, 3] = out[3, :3] = mass * np.asarray(com)
    out[3, 3] = mass
    return out


def parameters_of_inertia(J: Array) -> Array:
    """Return phi (10,) = [m, mc, Ixx, Ixy, Iyy, Ixz, Iyz, Izz] about the frame's origin (kg, kg·m, kg·m²)."""
    second = J[:3, :3]
    # I = tr(S) 1 - S.
    inertia = np.trace(second) * np.eye(3) - second
    rows, columns = (0, 0, 1, 0, 1, 2), (0, 1, 1, 2, 2, 2)
    return np.concatenate([[J[3, 3]], J[:3, 3], inertia[rows, columns]])


def of_parameters(phi: Array) -> Array:
    """Return the pseudo-inertia (4, 4) of phi (10,)."""
    xx, xy, yy, xz, yz, zz = phi[4:]
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    out = np.empty((4, 4))
    # The inverse: tr(I) = 2 tr(S), S = tr(I) / 2 - I.
    out[:3, :3] = 0.5 * np.trace(inertia) * np.eye(3) - inertia
    out[:3, 3] = out[3, :3] = phi[1:4]
    out[3, 3] = phi[0]
    return out


def place_inertia(J: Array, rotation: Array, position: Array) -> Array:
    """Return J of the same body in another frame, given the pose (3, 3), (3,) m of its present frame in the other."""
    move = np.eye(4)
    move[:3, :3], move[:3, 3] = rotation, position
    # Points go to M p, so their second moments go to M J M'.
    return move @ J @ move.T


def draw_sip(
    size: skeleton.Proportions,
    subject: Subject,
    seed: int,
    *,
    tolerances: skeleton.LabTolerances,
    population: int | None,
) -> Sip:
    """Draw the true parameters of the 16 segments; their masses add up to the subject's exactly.

    All persons of one ``population`` differ from the midpoint of the tables alike (`_POPULATION`), None = not at all.
    Of the ``tolerances``: ``segment_mass`` is the relative sd of a kind of segment, common to both sides; ``side_mass``
    that between right and left; ``segment_shape`` that of the linear map of the shape; ``com`` the sd of the CoM shift
    in units of the body's own spread along each axis.
    """
    table = skeleton.virtual_people()["segments"][subject.sex]
    rng = skeleton.stream(seed, "flesh")
    factor = {kind: np.exp(tolerances.segment_mass * rng.normal()) for kind in table}
    if population is not None:
        common = skeleton.stream(population, "population")
        factor = {kind: own * np.exp(_POPULATION * common.normal()) for kind, own in factor.items()}
    bodies = []
    for segment in skeleton.TRUE_SEGMENTS:
        kind = next((k for k in skeleton.ARM_AND_LEG if segment.endswith(k)), segment)
        percent, *rest = table[kind]
        place = size[kind] * np.array(rest)
        if segment.startswith("left"):
            # Mirror image: z to the other side.
            place[2] = -place[2]
        side = np.exp(tolerances.side_mass * rng.normal() if kind != segment else 0.0)
        inertia = true_pseudo_inertia(percent * factor[kind] * side, place[:3], place[3:])
        # a random linear map of the body about its CoM, and a random shift relative to its own size
        com = inertia[:3, 3] / inertia[3, 3]
        centred = place_inertia(inertia, np.eye(3), -com)
        spread = np.sqrt(np.diag(centred)[:3] / inertia[3, 3])
        shape = np.eye(3) + tolerances.segment_shape * rng.normal(size=(3, 3))
        bodies.append(place_inertia(centred, shape, com + tolerances.com * spread * rng.normal(size=3)))
    total = sum(J[3, 3] for J in bodies)
    # Linear in J: masses add up to the declared one, shapes stay.
    phi = np.concatenate([parameters_of_inertia(J * subject.mass / total) for J in bodies])
    return Sip(skeleton.TRUE_SEGMENTS, phi, np.zeros((phi.size, phi.size)))


@dataclass(frozen=True, eq=False)
class AddedLoad:
    """A load fixed to a segment of the true body: ``mass`` kg, ``place`` (3,) m its CoM in the segment's frame,
    ``radii`` (3,) m of gyration.
    """

    segment: str
    mass: float
    place: Array
    radii: Array = field(default_factory=lambda: np.full(3, 0.03))

    def __post_init__(self) -> None:
        refuse_unknown("segment of the true body", self.segment, skeleton.TRUE_SEGMENTS)
        if not 0 < self.mass < 30:
            raise BiodanceError(f"AddedLoad on {self.segment}: mass = {self.mass} kg; legal: above 0 and below 30 kg.")
        freeze(self, "AddedLoad", place=(3,), radii=(3,))


@dataclass(frozen=True)
class Habits:
    """How a person stands, drawn once: ``angles`` rad added to true joints by name; ``stance`` m between the ankles;
    ``toe_out`` rad (right, left).
    """

    angles: dict[str, float]
    stance: float
    toe_out: tuple[float, float]


@dataclass(frozen=True, eq=False)
class Person:
    """A subject whose truth is known: ``body`` of 16 segments with its true SIP WITHOUT ``loads``, markers as glued in
    the present session, in a posture with the joints ``bent`` by so many rad beside upright standing.
    """

    subject: Subject
    seed: int
    size: skeleton.Proportions
    body: Body
    habits: Habits
    loads: tuple[AddedLoad, ...] = ()
    bent: Mapping[str, float] = field(default_factory=dict)

    @property
    def loaded_body(self) -> Body:
        """The true body with its loads: the one that moves on the plate."""
        phi = np.array(self.body.sip.phi)
        for load in self.loads:
            i = 10 * skeleton.TRUE_SEGMENTS.index(load.segment)
            phi[i : i + 10] += parameters_of_inertia(true_pseudo_inertia(load.mass, load.place, load.radii))
        return replace(
            self.body, name="virtual person with loads", sip=Sip(skeleton.TRUE_SEGMENTS, phi, self.body.sip.covariance)
        )

    @property
    def mass(self) -> float:
        """True mass with loads, kg."""
        return float(self.loaded_body.sip.mass.sum())

    def with_markers_moved(self, shifts: Mapping[str, Array]) -> "Person":
        """Return the person with markers moved by ``shifts`` (3,) m in their true segments' frames; UnknownName lists
        the labels.
        """
        markers = self.body.markers
        position = np.array(markers.position)
        for label, shift in shifts.items():
            refuse_unknown("marker of the virtual subject", label, markers.names)
            position[markers.names.index(label)] += shift
        return replace(self, body=replace(self.body, markers=replace(markers, position=position)))


NO_SHIFTS: Mapping[str, Array] = MappingProxyType({})
_BEYOND = {"hip": "thigh", "knee": "shank", "ankle": "foot", "shoulder": "upper_arm"}
MOVABLE = (*(f"{side}_{joint}" for side in SIDES for joint in _BEYOND), "lumbar", "neck")
"""Joints whose true centre can be moved."""


def make_person(
    subject: Subject,
    seed: int,
    *,
    tolerances: skeleton.LabTolerances = skeleton.REALISTIC,
    loads: tuple[AddedLoad, ...] = (),
    session: int = 0,
    joint_shifts: Mapping[str, Array] = NO_SHIFTS,
    population: int | None = None,
) -> Person:
    """Return the virtual person number ``seed`` of the given mass (kg), stature (m) and sex.

    The same ``seed`` is the same body for ever; ``session`` only moves the markers as another day does. ``loads`` come
    on top of the subject's mass. ``joint_shifts`` (3,) m by joint (one of ``MOVABLE``) move true joint centres in the
    frame of the segment before them. People of one ``population`` have something in common (`draw_sip`).
    """
    t = tolerances
    size = skeleton.draw_proportions(
        subject, seed, length_sd=t.segment_length, centre_sd=t.joint_centre, tilt_sd=t.joint_axis
    )
    size = _with_joints_moved(size, joint_shifts)
    sip = draw_sip(size, subject, seed, tolerances=t, population=population)
    joints = skeleton.build_joints(size)
    ranges = skeleton.virtual_people()["range_deg"]
    lower, upper = np.radians([ranges[j.name.removeprefix("right_").removeprefix("left_")] for j in joints]).T
    limits = JointLimits(
        lower, upper, np.full(len(joints), 15.0), np.full(len(joints), -400.0), np.full(len(joints), 400.0)
    )
    boxes = np.stack([_box(sip.of(segment)) for segment in skeleton.TRUE_SEGMENTS])
    body = Body(
        "virtual person",
        skeleton.TRUE_SEGMENTS,
        joints,
        sip,
        limits,
        skeleton.glue_markers(size, seed, session, error=t.marker_placement),
        boxes,
        boxes,
        {side: _sole(size, side) for side in SIDES},
    )
    return Person(subject, seed, size, body, _habits(size, seed), tuple(loads))


def _with_joints_moved(size: skeleton.Proportions, shifts: Mapping[str, Array]) -> skeleton.Proportions:
    moved = np.array(size.centre_shift)
    for joint, shift in shifts.items():
        refuse_unknown("joint of the virtual subject whose centre can be moved", joint, MOVABLE)
        side, _, kind = joint.rpartition("_")
        moved[
            skeleton.TRUE_SEGMENTS.index(
                f"{side}_{_BEYOND[kind]}" if side else {"lumbar": "lumbar", "neck": "head"}[kind]
            )
        ] += shift
    return replace(size, centre_shift=moved)


def _box(phi: Array) -> Array:
    """Return the box (2, 3) m about the CoM that has the segment's second moments, for drawing only."""
    J = of_parameters(phi)
    com = J[:3, 3] / J[3, 3]
    # A uniform box of half side h has the second moment h² / 3.
    half = np.sqrt(3.0 * np.clip(np.diag(J)[:3] / J[3, 3] - com**2, 1e-6, None))
    return np.stack([com - half, com + half])


def _sole(size: skeleton.Proportions, side: str) -> Foot:
    """Return the outline of a foot on the ground: heel 27 % of its length behind the ankle (Millard et al. 2017)."""
    back, front, half = -0.27 * size["sole"], 0.73 * size["sole"], size["sole_breadth"] / 2
    right = [(back, 0.6 * half), (0.55 * front, half), (front, 0.5 * half)]
    corners = [*right, *((x, -z) for x, z in reversed(right))]
    outline = [skeleton.on_side(np.array([x, -size["ankle_height"], z]), side) for x, z in corners]
    # Mirrored corners run the other way round: turned back to the same sense.
    return Foot(skeleton.TRUE_SEGMENTS.index(f"{side}_foot"), np.array(outline if side == "right" else outline[::-1]))


def _habits(size: skeleton.Proportions, seed: int) -> Habits:
    """Draw how the person stands and carries head, trunk and arms."""
    rng = skeleton.stream(seed, "habits")
    mean_sd = {
        "lumbar_flexion": (2.0, 2.0),
        "thorax_flexion": (3.0, 2.0),
        "neck_flexion": (-4.0, 4.0),
        "wrist_flexion": (8.0, 4.0),
        "forearm_pronation": (50.0, 8.0),
    }
    angles: dict[str, float] = {}
    for name, (mean, sd) in mean_sd.items():
        value = float(np.radians(mean + sd * rng.normal()))
        both = name.startswith(("wrist", "forearm"))
        angles |= {f"{side}_{name}": value for side in SIDES} if both else {name: value}
    stance = 0.115 * size["stature"] * (1 + 0.08 * rng.normal())
    right, left = np.radians(7.0 + 2.5 * rng.normal(size=2))
    return Habits(angles, float(stance), (float(right), float(left)))


_REPLACED = {"shank": ("shank", "foot"), "foot": ("foot",), "forearm": ("forearm", "hand")}
"""What a prosthesis replaces, by its first true segment."""
_STUMP = 0.85
"""Share of its length to which the first segment is squeezed towards the joint: a stump in a socket above a tube."""


def with_prostheses(person: Person, lighter: Mapping[str, float]) -> Person:
    """Return the person with prostheses, each so many kg ``lighter`` than the limb from its first segment on.

    Such a limb begins with a shank, foot or forearm. On the scale the person weighs what was declared, so that all
    other segments weigh more.

    Raises
    ------
    UnknownName
        No prosthesis begins with that segment.
    BiodanceError
        The limb is no heavier than it shall be lighter.
    """
    sip = person.body.sip
    for segment, less in lighter.items():
        side, _, first = segment.removesuffix("_hand").partition("_")
        if first not in _REPLACED or side not in SIDES:
            legal = tuple(f"{side}_{one}" for side in SIDES for one in _REPLACED)
            raise UnknownName.of("segment that a prosthesis begins with", segment, legal)
        limb = [skeleton.TRUE_SEGMENTS.index(f"{side}_{part}") for part in _REPLACED[first]]
        bodies, mass = [of_parameters(phi) for phi in sip.phi.reshape(-1, 10)], float(sip.mass[limb].sum())
        if not 0 < less < mass:
            raise BiodanceError(
                f"{segment}: the limb weighs {mass:.2f} kg; it can be 0 to {mass:.2f} kg lighter, not {less}."
            )
        # y is along the limb: matter goes to `_STUMP` of its distance from the joint, the mass stays.
        squeezed = np.diag([1.0, _STUMP, 1.0, 1.0])
        bodies[limb[0]] = squeezed @ bodies[limb[0]] @ squeezed
        total = float(sip.mass.sum())
        # What the limb loses all others gain in proportion.
        scale = [1 - less / mass if k in limb else 1 + less / (total - mass) for k in range(len(bodies))]
        phi = np.concatenate([parameters_of_inertia(times * J) for times, J in zip(scale, bodies, strict=True)])
        sip = Sip(sip.segments, phi, sip.covariance)
    return replace(person, body=replace(person.body, sip=sip))


def reference_angles(person: Person) -> Array:
    """Return the true joint angles (39,) rad in which the markers were glued: upright, arms slightly away, or bent."""
    angles = dict(person.habits.angles) | dict(person.bent)
    for side in SIDES:
        flexion, adduction, rotation, elbow = np.radians(STAND.values[f"{side}_arm"])
        angles |= {f"{side}_shoulder_flexion": flexion, f"{side}_shoulder_adduction": adduction}
        angles |= {f"{side}_shoulder_rotation": rotation, f"{side}_elbow_flexion": elbow}
    return np.array([angles.get(joint.name, 0.0) for joint in person.body.joints])


MERGED: dict[str, tuple[str, tuple[str, ...]]] = {
    "pelvis": ("", ("pelvis",)),
    "right_thigh": ("right_hip_rotation", ("right_thigh",)),
    "right_shank": ("right_knee_flexion", ("right_shank",)),
    "right_foot": ("right_ankle_inversion", ("right_foot",)),
    "left_thigh": ("left_hip_rotation", ("left_thigh",)),
    "left_shank": ("left_knee_flexion", ("left_shank",)),
    "left_foot": ("left_ankle_inversion", ("left_foot",)),
    "trunk_head": ("lumbar_rotation", ("lumbar", "thorax", "head")),
    "right_upper_arm": ("right_shoulder_rotation", ("right_upper_arm",)),
    "right_forearm_hand": ("right_elbow_flexion", ("right_forearm", "right_hand")),
    "left_upper_arm": ("left_shoulder_rotation", ("left_upper_arm",)),
    "left_forearm_hand": ("left_elbow_flexion", ("left_forearm", "left_hand")),
}
"""Each of the 12 segments: the true joint in whose frame it is written ("" = the root), and its true segments."""
CARRIERS = {"trunk_head": "thorax", "right_forearm_hand": "right_forearm", "left_forearm_hand": "left_forearm"}
"""The true segment that carries a load on a merged one."""
TrueFrames = dict[str, tuple[Array, Array]]


def true_frames(person: Person, body: Body, q: Array | None = None) -> tuple[TrueFrames, TrueFrames]:
    """Return the poses (3, 3), (3,) m of the 12 frames and of the 16 segments at ``q`` (46,), by default as glued."""
    if q is None:
        q = body.neutral
        q[7:] = reference_angles(person)
    pose = poses(body, q)
    merged = {}
    for segment, (joint, _) in MERGED.items():
        j = body.joint_index(joint) if joint else -1
        merged[segment] = (
            (pose.joint_rotation[0, j], pose.joint_position[0, j])
            if joint
            else (pose.root_rotation[0], pose.root_position[0])
        )
    return merged, {name: (pose.rotation[0, i], pose.position[0, i]) for i, name in enumerate(skeleton.TRUE_SEGMENTS)}


def merged_sip(person: Person, body: Body) -> Sip:
    """Return the true parameters of ``body`` (with or without loads) in the 12 segments, each in its own true joint
    frame.

    Joints that the 12-segment model lacks (thorax, neck, forearm, wrist) are frozen in the posture in which the markers
    were glued.
    """
    merged, true = true_frames(person, body)
    phi = []
    for segment, (_, parts) in MERGED.items():
        turn, place = merged[segment]
        total = np.zeros((4, 4))
        for part in parts:
            part_turn, part_place = true[part]
            # Second moments of all parts add in one frame.
            total += place_inertia(of_parameters(body.sip.of(part)), turn.T @ part_turn, turn.T @ (part_place - place))
        phi.append(parameters_of_inertia(total))
    flat = np.concatenate(phi)
    return Sip(tuple(MERGED), flat, np.zeros((flat.size, flat.size)))


def load_on(person: Person, segment: str, mass: float, *, place: Array | None = None) -> AddedLoad:
    """Return a load of ``mass`` kg on one of the 12 segments.

    ``place`` (3,) m is its centre in that segment's true joint frame; by default 6 cm outwards of the segment's centre
    of mass (pelvis and trunk: 10 cm backwards). The forearm carries for forearm_hand, the thorax for trunk_head.

    Raises
    ------
    UnknownName
        ``segment`` is none of the 12.
    """
    refuse_unknown("segment of the 12-segment model", segment, MERGED)
    if place is None:
        away = {"r": (0.0, 0.0, 0.06), "l": (0.0, 0.0, -0.06)}.get(segment[0], (-0.10, 0.0, 0.0))
        place = merged_sip(person, person.body).com[tuple(MERGED).index(segment)] + np.array(away)
    carrier = CARRIERS.get(segment, segment)
    merged, true = true_frames(person, person.body)
    (turn, origin), (part_turn, part_origin) = merged[segment], true[carrier]
    return AddedLoad(carrier, mass, part_turn.T @ (origin + turn @ place - part_origin))


def place_in_12(person: Person, load: AddedLoad) -> tuple[str, Array]:
    """Return on which of the 12 segments a load sits, and its place (3,) m in that segment's true joint frame."""
    segment = next(name for name, (_, parts) in MERGED.items() if load.segment in parts)
    merged, true = true_frames(person, person.body)
    (turn, origin), (part_turn, part_origin) = merged[segment], true[load.segment]
    return segment, turn.T @ (part_origin + part_turn @ load.place - origin)
