"""Joint moments and powers over a cycle, per kg of body mass, with what the inertial parameters leave uncertain."""

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from biodance.body.body import Body
from biodance.cycles.curves import CycleCurve, over_cycle, seen_from
from biodance.cycles.cut import Cycle
from biodance.identification.torques import ground_torques, torque_regressor_of_links
from biodance.motion.kinematics import chains
from biodance.records import SIDES, Array, Motion, Sip, Wrench
from biodance.records.motion import BY_FRAME

_ENOUGH = 0.8
"""Share of a cycle in which a moment or a power must be known."""
_BEYOND = 0.05
"""s before and behind a cycle that are looked at for its first and last per cent."""


def load_curves(
    cycle: Cycle, body: Body, sip: Sip, motion: Motion, feet: Mapping[str, Wrench], known: NDArray[np.bool_]
) -> Iterator[CycleCurve]:
    """Yield the moments (N·m/kg) and powers (W/kg) of a cycle, those of its own side and of the trunk in a gait cycle.

    ``feet`` the wrenches on the right and the left foot, ``known`` (T, 2) where they are known: elsewhere the leg's
    values are NaN. A curve of which less than `_ENOUGH` is known is left out: a mean over cycles of which one shows the
    stance and others the swing would be nobody's. ``sip`` parameters with covariance, whose total is the body mass. A
    moment is what the muscles do about a joint's axis, positive as its angle; a power sums over the axes of a joint,
    positive where they give energy.

    Notes
    -----
    With torque = Y phi - c (`identification.torques`) a power is sum(v torque) over the axes, so that its variance is
    y' C y with y = sum(v Y): the axes of a joint are not independent.
    """
    near = (motion.time >= cycle.start - _BEYOND) & (motion.time <= cycle.end + _BEYOND)
    motion, known = replace(motion, **{name: getattr(motion, name)[near] for name in BY_FRAME}), known[near]
    ground = {
        f"{side}_foot": Wrench(motion.time, np.where(known[:, foot, None], feet[f"{side}_foot"].value[near], 0.0))
        for foot, side in enumerate(SIDES)
    }
    names, rows, given = _moments_and_powers(body, motion, ground)
    own = [(k, seen) for k, (joint, _) in enumerate(names) if (seen := seen_from(cycle, joint)) is not None]
    columns, share = [k for k, _ in own], np.eye(sip.phi.size) if body.sharing is None else body.sharing
    rows, given, mass = rows[:, columns], given[:, columns], float(sip.mass.sum())
    variance = np.sum((rows @ (share @ sip.covariance @ share.T)) * rows, axis=-1)
    value, sd = (rows @ (share @ sip.phi) - given) / mass, np.sqrt(np.maximum(variance, 0.0)) / mass
    for column, (k, (side, joint, sign)) in enumerate(own):
        kind = names[k][1]
        of_leg = joint.startswith(("hip", "knee", "ankle"))  # which needs its own foot, trunk and arms nothing
        use = motion.determined & (known[:, SIDES.index(side)] if of_leg else True)
        shown, sign = np.where(use, 1.0, np.nan), sign if kind == "moment" else 1.0
        unit = "N·m/kg" if kind == "moment" else "W/kg"
        curves = sign * shown * value[:, column], shown * sd[:, column]
        one = over_cycle(cycle, f"{joint}_{kind}", side, unit, motion.time, *curves)
        if np.isfinite(one.value).mean() > _ENOUGH:
            yield one


def _moments_and_powers(
    body: Body, motion: Motion, ground: Mapping[str, Wrench]
) -> tuple[list[tuple[str, str]], Array, Array]:
    """Return joint and kind ("moment", "power") of m quantities, their rows (T, m, 10N) and what the ground gives (T,
    m): value = rows phi - given.
    """
    regressor, given = torque_regressor_of_links(body, motion), ground_torques(body, motion, ground)
    rates, groups = motion.v[:, body.n_root :], [list(chain) for chain in chains(body)]
    rows = [np.einsum("tj,tjp->tp", rates[:, axes], regressor[:, axes]) for axes in groups]
    work = [np.sum(rates[:, axes] * given[:, axes], axis=1) for axes in groups]
    names = [(joint.name, "moment") for joint in body.joints]
    names += [(body.joints[axes[-1]].name.rpartition("_")[0], "power") for axes in groups]
    stacked = np.concatenate([regressor, np.stack(rows, axis=1)], axis=1)
    return names, stacked, np.concatenate([given, np.stack(work, axis=1)], axis=1)
