"""What the table leaves open about a person, answered by the session: where the trunk's matter lies when movement puts
its joint elsewhere than the table cuts the trunk from the pelvis (where the table has it in the person, or along with
the joint), and whether the masses of the two sides are alike or each on its own: the most probable answer is kept.
Whether the masses are the table's or those of the published studies together no session tells for sure: both count, as
probable as it makes them.
"""

from dataclasses import replace
from itertools import product

import numpy as np

from biodance.body.body import Body
from biodance.body.tables.error_sizes import error_size
from biodance.identification.information import Information
from biodance.identification.posterior import posterior
from biodance.records import Array, Sip
from biodance.uncertainty.caution import shift_slope, widened

_ALONG = 1
"""The axis along the spine in the frames of pelvis and trunk."""
ODDS = np.log(2.0)
"""Log evidence by which sides each on their own must be more probable than sides alike, which most people have."""
_TOLD = 1.0
"""mm: a joint of the trunk nearer to the table's cut than this is not told."""


def goes_along(prior: Sip, body: Body) -> bool:
    """Whether the table ``prior`` of ``body`` has the trunk's matter along with the joint."""
    if body.at_joint is None:
        return False
    off = [np.linalg.norm(prior.com - table.com) for table in (body.sip, body.at_joint)]
    return bool(off[1] < off[0])


def placed_as(prior: Sip, body: Body, *, along: bool) -> Sip:
    """Return the table ``prior`` of ``body`` with the trunk's matter ``along`` with the joint or at the table's cut,
    unsure of its place; as it is where it lies there already or there is no other place.
    """
    if body.at_joint is None or goes_along(prior, body) == along:
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
        slope = way * shift_slope(table.phi[cut])[:, _ALONG]
        covariance[cut, cut] += np.outer(slope, slope)
    other = widened(replace(table, covariance=covariance), body.joint_errors)
    ratio = mass / float(other.mass.sum())
    return replace(other, phi=ratio * other.phi, covariance=ratio**2 * np.asarray(other.covariance))


def with_sides(table: Sip, *, apart: bool) -> Sip:
    """Return ``table``, of which the masses of right and left are as alike as tables have them (or ``apart``), with
    these masses each on its own (or alike again): their difference is as uncertain as that of two people, their sum as
    before. Masses that the person's own shape told stay as they are.
    """
    alike = error_size("left_right_correlation", "mass")
    more, sign = alike / (1 - alike) if apart else -alike, np.array([1.0, -1.0])
    covariance = np.array(table.covariance)
    for i, name in enumerate(table.segments):
        other = name.replace("right_", "left_")
        if other == name or name in table.measured or other not in table.segments:
            continue
        at = 10 * np.array([i, table.segments.index(other)])
        unsure = sign @ table.covariance[np.ix_(at, at)] @ sign / 4
        way = np.zeros(len(table.phi))
        for k, one in zip(at, sign, strict=True):
            way[k : k + 10] = one * table.phi[k : k + 10] / max(float(table.phi[k]), 1e-12)
        covariance += more * unsure * np.outer(way, way)
    return replace(table, covariance=covariance)


def studies_share(table: Sip, body: Body) -> float:
    """Return how far the masses of ``table`` lie on the way from those of the body's table (0) to the mean of the
    published studies (1); 0 where the body has no such second opinion.
    """
    if not body.studies:
        return 0.0
    first, way = _way_to_studies(body)
    return float(np.clip(way @ (table.mass / table.mass.sum() - first) / (way @ way), 0.0, 1.0))


def with_studies(table: Sip, body: Body, share: float) -> Sip:
    """Return ``table`` with its masses at ``share`` of the way to the mean of the published studies, each segment's
    matter in proportion, and with what being unsure between the two opinions adds to the covariance.
    """
    then = studies_share(table, body)
    if share == then:
        return table
    mass, per_kg = table.mass, table.phi.reshape(-1, 10) / table.mass[:, None]
    way = float(mass.sum()) * _way_to_studies(body)[1]
    both = (per_kg * way[:, None]).ravel()
    unsure = share * (1 - share) - then * (1 - then)
    phi = (per_kg * (mass + (share - then) * way)[:, None]).ravel()
    return replace(table, phi=phi, covariance=table.covariance + unsure * np.outer(both, both))


def _way_to_studies(body: Body) -> tuple[Array, Array]:
    """Return the shares (N,) of the body mass in the table, and what the studies' have more."""
    first = body.sip.mass / body.sip.mass.sum()
    return first, np.array(body.studies) - first


def _weigh_studies(data: Information, table: Sip, body: Body) -> tuple[Sip, tuple[str, ...]]:
    """Return the ``table`` moved towards the studies by their probability after the ``data`` (half beforehand), and
    this in words.
    """
    if not body.studies:
        return table, ()
    masses = np.array([table.mass, table.mass + table.mass.sum() * _way_to_studies(body)[1]])
    other = replace(table, phi=table.phi * np.repeat(masses[1] / masses[0], 10))
    gain = posterior(data, other).log_evidence - posterior(data, table).log_evidence
    share = float(1 / (1 + np.exp(-gain)))
    words = (
        f"The masses are expected {100 * share:.0f} % of the way from the table to the mean of the published studies "
        f"(logarithm of the Bayes factor {gain:.1f})."
    )
    return with_studies(table, body, share), (words,)


def more_probable_table(data: Information, table: Sip, body: Body) -> tuple[Sip, bool, tuple[str, ...]]:
    """Return the ``table`` with the trunk's matter and the sides as the ``data`` of the session make more probable
    (evidence under the table's own standard deviations and those of the trunk's place), its masses between the table's
    and those of the published studies, whether the sides are apart in it, and all of this in words.
    """
    places = (False, True) if body.at_joint is not None else (False,)
    placed = [_at(body, float(table.mass.sum()), along=x) if len(places) > 1 else table for x in places]
    choices = {(x, s): with_sides(placed[x], apart=True) if s else placed[x] for x, s in product(places, (False, True))}
    evidence = {choice: posterior(data, one).log_evidence for choice, one in choices.items()}
    along, apart = best = max(evidence, key=lambda choice: evidence[choice] - ODDS * choice[1])
    words = []
    if len(places) > 1:
        trunk, gain = body.segment_index("trunk_head"), evidence[best] - evidence[not along, apart]
        off = 1e3 * float(np.linalg.norm((placed[1].com - placed[0].com)[trunk]))
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
    table, told = _weigh_studies(data, choices[best], body)
    return table, apart, (*words, *told)
