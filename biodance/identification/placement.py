"""Where the trunk's matter lies when movement puts its joint elsewhere than the table cuts the trunk from the pelvis:
where the table has it in the person, or along with the joint. Both are measured, the more probable one is kept.
"""

import numpy as np

from biodance.body.body import Body
from biodance.identification.information import Information
from biodance.identification.posterior import posterior
from biodance.records import Sip
from biodance.uncertainty.caution import widened


def goes_along(prior: Sip, body: Body) -> bool:
    """Whether the table ``prior`` of ``body`` has the trunk's matter along with the joint."""
    if body.at_joint is None:
        return False
    off = [np.linalg.norm(prior.com - table.com) for table in (body.sip, body.at_joint)]
    return bool(off[1] < off[0])


def placed_as(prior: Sip, body: Body, *, along: bool) -> Sip:
    """Return the table ``prior`` of ``body`` with the trunk's matter ``along`` with the joint or at the table's cut; as
    it is where that is so already or there is no other place.
    """
    if body.at_joint is None or goes_along(prior, body) == along:
        return prior
    other = widened(body.at_joint if along else body.sip)
    ratio = float(prior.mass.sum() / other.mass.sum())
    return Sip(other.segments, ratio * other.phi, ratio**2 * np.asarray(other.covariance))


def more_probable_place(data: Information, table: Sip, body: Body) -> tuple[Sip, str]:
    """Return the ``table`` with the trunk's matter where the ``data`` of the session are more probable (evidence under
    the table's own standard deviations), and that in words; "" where there is no choice.
    """
    if body.at_joint is None:
        return table, ""
    both = [placed_as(table, body, along=along) for along in (False, True)]
    evidence = [posterior(data, one).log_evidence for one in both]
    gain, trunk = evidence[1] - evidence[0], body.segment_index("trunk_head")
    apart = 1e3 * float(np.linalg.norm((both[1].com - both[0].com)[trunk]))
    where = "is taken along with the joint" if gain > 0 else "stays where the table has it"
    return both[int(gain > 0)], (
        f"The trunk turns {apart:.0f} mm from where the table cuts it from the pelvis. Its matter {where}: more "
        f"probable by a natural logarithm of {abs(gain):.1f}."
    )
