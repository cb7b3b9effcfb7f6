"""Where the trunk's matter lies when movement puts its joint elsewhere than the table cuts the trunk from the pelvis:
where the table has it in the person, or along with the joint. Both are measured, the more probable one is kept; either
way the place is known no better than the two are apart.
"""

from dataclasses import replace

import numpy as np

from biodance.body.body import Body
from biodance.identification.information import Information
from biodance.identification.posterior import posterior
from biodance.records import Sip
from biodance.uncertainty.caution import shift_slope, widened

_ALONG = 1
"""The axis along the spine in the frames of pelvis and trunk."""


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
    other = widened(replace(table, covariance=covariance))
    ratio = mass / float(other.mass.sum())
    return replace(other, phi=ratio * other.phi, covariance=ratio**2 * np.asarray(other.covariance))


def more_probable_place(data: Information, table: Sip, body: Body) -> tuple[Sip, str]:
    """Return the ``table`` with the trunk's matter where the ``data`` of the session are more probable (evidence under
    the table's own standard deviations and those of its place), and that in words; "" where there is no choice.
    """
    if body.at_joint is None:
        return table, ""
    both = [_at(body, float(table.mass.sum()), along=along) for along in (False, True)]
    evidence = [posterior(data, one).log_evidence for one in both]
    gain, trunk = evidence[1] - evidence[0], body.segment_index("trunk_head")
    apart = 1e3 * float(np.linalg.norm((both[1].com - both[0].com)[trunk]))
    where = "is taken along with the joint" if gain > 0 else "stays where the table has it"
    return both[int(gain > 0)], (
        f"The trunk turns {apart:.0f} mm from where the table cuts it from the pelvis. Its matter {where}: more "
        f"probable by a natural logarithm of {abs(gain):.1f}."
    )
