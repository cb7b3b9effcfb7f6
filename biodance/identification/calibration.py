"""Regression calibration of a session: its data discounted by what twins and plates disturb, with what noise in the
kinematics takes from the parameters given back.
"""

from dataclasses import dataclass, replace

from biodance.body.body import Body
from biodance.identification.dilution import carried_away, undiluted
from biodance.identification.information import Information
from biodance.identification.learning import learn_noise
from biodance.identification.loads import may_carry
from biodance.identification.mismatch import Mismatch, Sizes, evident_sizes, temper
from biodance.identification.placement import more_probable_table
from biodance.identification.posterior import Posterior, posterior
from biodance.identification.statistics import Statistics
from biodance.records import Sip
from biodance.uncertainty.noise import Noise

_ROUNDS, _AGAIN = 2, 4
"""How often the dilution is measured under the parameters of the fit before; rounds of learning the noise anew after
it."""


@dataclass(frozen=True, eq=False)
class Calibrated:
    """``data`` whitened, less what disturbs them; ``sizes`` of the disturbances; ``noise`` as learned; ``diluted``
    whether noise in the kinematics takes from the parameters what cannot be given back.
    """

    data: Information
    sizes: Sizes
    noise: Noise
    diluted: bool = False


def discounted(total: Statistics, noise: Noise, found: Mismatch | None, room: Sip) -> Calibrated:
    """Return the data of ``total`` whitened by ``noise``, less what twins and plates disturb (``found``), sizes chosen
    by evidence under the table ``room`` that may carry a load.
    """
    data = replace(total).information(noise)  # a copy of its own, see `learn_noise`
    if found is None:
        return Calibrated(data, Sizes(0.0, 1.0), noise)
    sizes = evident_sizes(data, found, room)
    return Calibrated(temper(data, found, sizes), sizes, noise)


def give_back(
    body: Body, total: Statistics, measured: Calibrated, found: Mismatch, before: Sip, *, open_table: bool
) -> Calibrated:
    """Return the ``measured`` data of ``total`` with their dilution given back; as they are, and ``diluted``, where
    that moves a mass by more than its standard deviation. ``before`` is the table, whose open questions the data
    answer if ``open_table``.
    """
    room = may_carry(body, before)
    now = measured
    for _ in range(_ROUNDS):
        table = more_probable_table(now.data, before, body)[0] if open_table else before
        belief = posterior(now.data, table)
        real = undiluted(total, _carrying(belief, now.data, body).mean, body.segments)
        now = discounted(real, learn_noise(real, room, rounds=_AGAIN)[0], found, room)
        if carried_away(belief, posterior(now.data, table)):
            return Calibrated(measured.data, measured.sizes, measured.noise, diluted=True)
    return now


def _carrying(belief: Posterior, data: Information, body: Body) -> Posterior:
    """Return the belief with a load where the data make one more probable: arms that are too light for what they
    carry show more than is predicted, and no dilution.
    """
    loaded = posterior(data, may_carry(body, belief.prior))
    return max(belief, loaded, key=lambda one: one.log_evidence)
