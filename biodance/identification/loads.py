"""What the table leaves open about a person: undeclared loads, the trunk's matter, sides that are not alike; and limbs
unlike the table: a prosthesis, of whose matter little is known, and devices that were weighed.

Loads: the ten parameters of a compact load, their second moment where mass and place are unknown, a body that may carry
one, and on which segment the place of one lies: a load is looked for in and near every segment's box, and near a joint
the box of the neighbour is as near.

The session answers where the trunk's matter lies when movement puts its joint elsewhere than the table cuts the trunk
from the pelvis (where the table has it in the person, or along with the joint), and whether the masses of the two sides
are alike or each on its own. All answers are measured, the most probable one is kept.

The table expects right and left alike. Below the joint of a prosthesis nothing is known but that there is less than the
whole body: mass and place of every segment there are open, the rest of the body weighs what they do not, and nothing
ties them to the other side.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.linalg import block_diag

from biodance.body.body import Body
from biodance.body.tables.error_sizes import error_size
from biodance.display import spaced
from biodance.identification.posterior import Information, find_posterior
from biodance.lab.markers.sets import other_side
from biodance.motion.kinematics import poses
from biodance.records import Array, Motion, Sip, Subject
from biodance.spatial import point_mass
from biodance.uncertainty.caution import shift_slope, widened_prior

_SCALE = 2.0
"""kg: typical size of a load; the answer changes little between half and twice of it."""
_RADIUS = 0.04
"""m: radius of gyration of a compact load."""
_NEAR = 0.5
"""A load may lie this share of the box beyond the box (straps, wrist weights)."""
UNDECLARED = 0.25
"""Share of a load's second moment that noise is learned with: 1 kg on every segment, undeclared."""


def compact_load(place: Array) -> Array:
    """Return the ten parameters (..., 10) per kg of compact loads with CoM at ``place`` (..., 3) m."""
    return point_mass(1.0, place, radius=_RADIUS)


def load_moments(body: Body, segment: int) -> Array:
    """Return U (10, k): U U' is the second moment of the parameters of a load of typical mass in or near the
    segment's box.
    """
    loads = _unit_loads(body, segment) * _SCALE
    # Second moment about zero, not the covariance: that there is a load at all is unknown.
    return _factor(loads.T @ loads / len(loads))


def unit_load(body: Body, segment: int) -> tuple[Array, Array]:
    """Return mean (10,) and factor G (10, k) of the covariance G G' of the parameters of a load of 1 kg in or near the
    segment's box.
    """
    loads = _unit_loads(body, segment)
    mean = loads.mean(axis=0)
    return mean, _factor((loads - mean).T @ (loads - mean) / len(loads))


def _unit_loads(body: Body, segment: int) -> Array:
    """Return the parameters (2000, 10) of loads of 1 kg, placed alike in and near the segment's box."""
    low, high = body.boxes[segment]
    margin = _NEAR * (high - low)
    place = np.random.default_rng(segment).uniform(low - margin, high + margin, (2000, 3))
    return compact_load(place)


def _factor(moment: Array) -> Array:
    """Return U (10, k) with U U' = ``moment`` (10, 10), without directions of no size."""
    value, vector = np.linalg.eigh(moment)
    keep = value > 1e-12 * value.max()
    # V E^1/2: directions of no size would be zero columns.
    return np.asarray(vector[:, keep] * np.sqrt(value[keep]))


def unknown_loads(body: Body, *, share: Array | None = None) -> Array:
    """Return the covariance (10N, 10N) that an undeclared load on every segment adds; ``share`` (N,) of a load's second
    moment for every segment, by default `UNDECLARED`.
    """
    room = np.full(len(body.segments), UNDECLARED) if share is None else share
    moments = (load_moments(body, i) for i in range(len(room)))
    return np.asarray(block_diag(*(much * U @ U.T for much, U in zip(room, moments, strict=True))))


def with_room(prior: Sip, loads: Array) -> Sip:
    """Return ``prior`` with a covariance that leaves room for `unknown_loads`. Noise is learned under it: with the
    total mass pinned to the declared one, a load would pass for slow noise.
    """
    return Sip(prior.segments, prior.phi, prior.covariance + loads)


_FRAMES = 50
"""Frames of a movement in which the boxes are compared: only joints that turn far change the answer."""


def nearest_segment(body: Body, motions: Sequence[Motion], segment: str, place: Array) -> str:
    """Return the segment to whose box a point is nearest in the mean over ``motions``.

    Parameters
    ----------
    body : Body
        Whose boxes are compared.
    motions : sequence of Motion
        In which the point is carried along.
    segment : str
        That carries the point; it is the answer where no other is nearer.
    place : Array
        (3,) m in the joint frame of ``segment``; NaN: not known.

    Returns
    -------
    str
        Its name; "" where the place is not known.
    """
    if not np.isfinite(place).all():
        return ""
    q = np.concatenate([one.q[:: max(1, len(one.q) // _FRAMES)] for one in motions])
    pose, own = poses(body, q), body.segment_index(segment)
    point, n = pose.points([own], place[None]), len(body.segments)
    # R'(point - origin) in every segment's axes: sum over j of R[t, s, j, i] d[t, s, j].
    local = np.einsum("tsji,tsj->tsi", pose.rotation[:, :n], point - pose.position[:, :n])
    low, high = np.moveaxis(body.boxes, 1, 0)
    # Distance outside a box: per axis what lies beyond either side, zero inside.
    far = np.linalg.norm(np.maximum(0.0, np.maximum(low - local, local - high)), axis=2).mean(axis=0)
    return segment if far[own] <= far.min() else body.segments[int(np.argmin(far))]


_ALONG = 1
"""The axis along the spine in the frames of pelvis and trunk."""
ODDS = np.log(2.0)
"""Log evidence by which sides each on their own must be more probable than sides alike, which most people have."""
_OPEN = 3.0
"""Times that the variance of a mass, as a share of it, is that of the other side in a limb that is open."""
_TOLD = 1.0
"""mm: a joint of the trunk nearer to the table's cut than this is not told."""


def matter_follows_joint(prior: Sip, body: Body) -> bool:
    """Whether the table ``prior`` of ``body`` has the trunk's matter along with the joint."""
    if body.at_joint is None:
        return False
    off = [np.linalg.norm(prior.com - table.com) for table in (body.sip, body.at_joint)]
    return bool(off[1] < off[0])


def with_matter_placed(prior: Sip, body: Body, *, along: bool) -> Sip:
    """Return the table ``prior`` of ``body`` with the trunk's matter ``along`` with the joint or at the table's cut,
    unsure of its place; as it is where it lies there already or there is no other place.
    """
    if body.at_joint is None or matter_follows_joint(prior, body) == along:
        return prior
    return _at(body, float(prior.mass.sum()), along=along)


def _at(body: Body, mass: float, *, along: bool) -> Sip:
    """Return the table of ``body`` at ``mass`` kg, with matter of pelvis and trunk each free to lie elsewhere along the
    spine by a standard deviation of the way between the table's cut and the joint.

    What wrench and movement tell is the first moment about the joint. How much of it is mass and how much is height,
    the table decides, and a table whose cut is not where the person bends does not know the height.
    """
    assert body.at_joint is not None
    table, trunk = body.at_joint if along else body.sip, body.segment_index("trunk_head")
    way = np.linalg.norm(body.at_joint.com[trunk] - body.sip.com[trunk])
    covariance = np.array(table.covariance)
    for i in (body.segment_index("pelvis"), trunk):
        cut = slice(10 * i, 10 * i + 10)
        # A shift along the spine by `way`: matter's first order, one direction.
        slope = way * shift_slope(table.phi[cut])[:, _ALONG]
        covariance[cut, cut] += np.outer(slope, slope)
    other = widened_prior(replace(table, covariance=covariance), body.joint_errors)
    ratio = mass / float(other.mass.sum())
    # phi scales with the mass, its covariance with the square.
    return replace(other, phi=ratio * other.phi, covariance=ratio**2 * np.asarray(other.covariance))


def with_sides(table: Sip, *, apart: bool) -> Sip:
    """Return ``table``, of which the masses of right and left are as alike as tables have them (or ``apart``), with
    these masses each on its own (or alike again): their difference is as uncertain as that of two people, their sum as
    before. Masses that the person's own shape told stay as they are.
    """
    alike = error_size("left_right_correlation", "mass")
    # var((m_r - m_l) / 2) is s² (1 - rho) / 2 for alike sides, s² / 2 apart: more by rho / (1 - rho), back by -rho.
    more, sign = alike / (1 - alike) if apart else -alike, np.array([1.0, -1.0])
    covariance = np.array(table.covariance)
    for i, name in enumerate(table.segments):
        other = name.replace("right_", "left_")
        if other == name or name in table.measured or other not in table.segments:
            continue
        at = 10 * np.array([i, table.segments.index(other)])
        # Variance of the half difference.
        unsure = sign @ table.covariance[np.ix_(at, at)] @ sign / 4
        way = np.zeros(len(table.phi))
        for k, one in zip(at, sign, strict=True):
            # One kg from left to right: each side's parameters in proportion to its mass.
            way[k : k + 10] = one * table.phi[k : k + 10] / max(float(table.phi[k]), 1e-12)
        covariance += more * unsure * np.outer(way, way)
    return replace(table, covariance=covariance)


PossibleTables = Mapping[tuple[bool, bool], Sip]
"""What may be known before the data, by whether the trunk's matter lies along with the joint, and the sides are
apart."""


def possible_tables(table: Sip, body: Body) -> PossibleTables:
    """Return the ``table`` with the trunk's matter and the sides as they may be. Where a limb is open, the sides are
    not asked for.
    """
    placed = {False: table}
    if body.at_joint is not None:
        placed = {along: _at(body, float(table.mass.sum()), along=along) for along in (False, True)}
    shares = np.diag(table.covariance)[::10] / np.maximum(table.mass, 1e-12) ** 2
    spread = dict(zip(table.segments, shares, strict=True))
    # An open limb (`with_open_limb`) is how the sides differ.
    is_open = any(spread[name] > _OPEN * spread.get(other_side(name), np.inf) for name in spread)
    sides = (False,) if is_open else (False, True)
    return {(x, s): with_sides(one, apart=True) if s else one for x, one in placed.items() for s in sides}


def more_probable_table(data: Information, tables: PossibleTables, body: Body) -> tuple[Sip, bool, tuple[str, ...]]:
    """Return the one of the ``tables`` of ``body`` that the ``data`` of the session make most probable (evidence under
    the table's own standard deviations and those of the trunk's place), whether the sides are apart in it, and both in
    words.
    """
    evidence = {choice: find_posterior(data, one).log_evidence for choice, one in tables.items()}
    # Sides apart need so much more evidence.
    along, apart = best = max(evidence, key=lambda choice: evidence[choice] - ODDS * choice[1])
    words = []
    if (not along, apart) in tables:
        trunk, gain = body.segment_index("trunk_head"), evidence[best] - evidence[not along, apart]
        off = 1e3 * float(np.linalg.norm((tables[True, apart].com - tables[False, apart].com)[trunk]))
        where = "is taken along with the joint" if along else "stays where the table has it"
        if off >= _TOLD:
            words.append(
                f"The trunk turns {off:.0f} mm from where the table cuts it from the pelvis. Its matter {where} "
                f"(logarithm of the Bayes factor {gain:.1f})."
            )
    if apart:
        words.append(
            f"The masses of the right and left side are taken each on its own, not as alike as the table expects "
            f"(logarithm of the Bayes factor {evidence[best] - evidence[along, False]:.1f})."
        )
    return tables[best], apart, tuple(words)


def segments_beyond(body: Body, segment: str) -> tuple[int, ...]:
    """Return the indices of ``segment`` and of all segments that hang on it."""
    own, parents = body.segment_joint, [joint.parent for joint in body.joints]
    first, found = own[body.segment_index(segment)], []
    # Walks up to the joint that carries `segment`: what reaches it hangs on it.
    for index, joint in enumerate(own):
        while joint > first:
            joint = parents[joint]
        found += [index] if joint == first else []
    return tuple(found)


def limb_and_rest(body: Body, segment: str, phi: Array) -> tuple[Array, Array, Array]:
    """Return the parameters (10N,) of 1 kg, in the proportions of ``phi`` (10N,), of the limb from ``segment`` on, of
    that of the other side, and of the body without both.
    """
    every = np.arange(len(body.segments))
    own, other = (np.isin(every, segments_beyond(body, limb)) for limb in (segment, other_side(segment)))
    parts = [phi * np.repeat(part, 10) for part in (own, other, ~(own | other))]
    first, second, rest = (part / part[::10].sum() for part in parts)
    return first, second, rest


def with_open_limb(body: Body, segment: str) -> Body:
    """Return ``body`` whose limb from ``segment`` on is a prosthesis: the masses there known to the share
    `unequal_limb mass`, and their places to `unequal_limb place`.
    """
    share, way = error_size("unequal_limb", "mass"), error_size("unequal_limb", "place")
    limb = segments_beyond(body, segment)

    def opened(table: Sip) -> Sip:
        covariance = np.array(table.covariance)
        rest = table.phi * ~np.repeat(np.isin(np.arange(len(body.segments)), limb), 10)
        for index in limb:
            own = slice(10 * index, 10 * index + 10)
            # The segment heavier by a share of itself, the rest of the body lighter by as much: total unchanged.
            less = -table.phi[10 * index] * rest / rest[::10].sum()
            less[own] = table.phi[own]
            covariance += share**2 * np.outer(less, less)
            slope = way * shift_slope(table.phi[own])
            covariance[own, own] += slope @ slope.T
        return replace(table, covariance=covariance)

    return _with_tables(body, opened)


def _with_tables(body: Body, changed: Callable[[Sip], Sip]) -> Body:
    """Return ``body`` with both of its tables ``changed``: at the table's cut, and along with the joint."""
    return replace(body, sip=changed(body.sip), at_joint=None if body.at_joint is None else changed(body.at_joint))


def with_devices(body: Body, worn: Mapping[str, float]) -> Body:
    """Return ``body``, whose mass holds what is worn, with the masses ``worn`` (kg by segment) on their segments,
    known, each at a place in or near the segment's box, and the person lighter by them.
    """
    carried = sum(worn.values())
    if not carried:
        return body

    def wearing(table: Sip) -> Sip:
        # The person without what is worn: lighter in proportion, covariance with the square.
        ratio = 1 - carried / float(table.mass.sum())
        phi, covariance = ratio * table.phi, ratio**2 * np.asarray(table.covariance)
        for segment, mass in worn.items():
            index = body.segment_index(segment)
            own = slice(10 * index, 10 * index + 10)
            mean, factor = unit_load(body, index)
            phi[own] += mass * mean
            # A load of m kg: mean m u, covariance m² G G'.
            covariance[own, own] += mass**2 * factor @ factor.T
        return replace(table, phi=phi, covariance=covariance)

    return _with_tables(body, wearing)


def with_declared_limbs(body: Body, subject: Subject) -> tuple[Body, str]:
    """Return the body with the devices and the prosthesis that were declared of the ``subject``, and both in words."""
    said = []
    if subject.devices:
        body = with_devices(body, subject.devices)
        worn = ", ".join(f"{mass:g} kg on the {spaced(segment)}" for segment, mass in subject.devices.items())
        said.append(f"Its table holds what is worn: {worn}.")
    if subject.prosthesis:
        body = with_open_limb(body, subject.prosthesis)
        said.append(f"From the {spaced(subject.prosthesis)} on it is a prosthesis, which no table knows.")
    return body, " ".join(said)
