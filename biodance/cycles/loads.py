"""Joint moments and powers over a cycle, per kg of body mass, with what the inertial parameters leave uncertain."""

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from biodance.body.body import Body
from biodance.cycles.curves import CycleCurve, over_cycle, seen_from, side_and_name
from biodance.cycles.cut import Cycle
from biodance.identification.torques import ground_torques, torque_regressor_of_links
from biodance.motion.kinematics import chains
from biodance.records import SIDES, Array, Motion, Sip, Wrench

_ENOUGH = 0.8
"""Of a cycle that must be known of a moment or a power."""


def load_curves(
    cycle: Cycle, body: Body, sip: Sip, motion: Motion, feet: Mapping[str, Wrench], told: NDArray[np.bool_]
) -> Iterator[CycleCurve]:
    """Yield the moments (N·m/kg) and powers (W/kg) of a cycle, those of its own side and of the trunk in a gait cycle.

    ``feet`` the wrenches on the right and the left foot, ``told`` (T, 2) where they are known: elsewhere the leg's
    values are NaN. A leg's curve of which less than `_ENOUGH` is known is left out: a mean over cycles of which one
    tells the stance and others the swing would be nobody's. ``sip`` parameters with covariance, whose total is the body
    mass. A moment is what the muscles do about a joint's axis, positive as its angle; a power sums over the axes of a
    joint, positive where they give energy.

    Notes
    -----
    With torque = Y phi - c (`identification.torques`) a power is sum(v torque) over the axes, so that its variance is
    y' C y with y = sum(v Y): the axes of a joint are not independent.
    """
    chosen = (motion.time >= cycle.start - 0.05) & (motion.time <= cycle.end + 0.05)
    here = _frames(motion, chosen)
    ground = {
        f"{side}_foot": Wrench(here.time, np.where(told[chosen, foot, None], feet[f"{side}_foot"].value[chosen], 0.0))
        for foot, side in enumerate(SIDES)
    }
    known = {side: here.determined & told[chosen, foot] for foot, side in enumerate(SIDES)}
    regressor, given = torque_regressor_of_links(body, here), ground_torques(body, here, ground)
    rates, mass = here.v[:, body.n_root :], float(sip.mass.sum())

    rows, needed, names, units = _rows(body, regressor, given, rates)
    whose = [seen_from(cycle, name.removesuffix("_moment").removesuffix("_power")) for name in names]
    rows = rows[:, [seen is not None for seen in whose]]
    needed = needed[:, [seen is not None for seen in whose]]
    share = np.eye(sip.phi.size) if body.sharing is None else body.sharing
    variance = np.sum((rows @ (share @ sip.covariance @ share.T)) * rows, axis=-1)
    value, sd = (rows @ (share @ sip.phi) - needed) / mass, np.sqrt(np.maximum(variance, 0.0)) / mass
    told_of = [(name, unit, seen) for name, unit, seen in zip(names, units, whose, strict=True) if seen is not None]
    for k, (name, unit, (side, _, sign)) in enumerate(told_of):
        sign = 1.0 if unit == "W/kg" else sign
        shown = np.where(_is_known(name, known, here), 1.0, np.nan)
        quantity = side_and_name(name)[1]
        one = over_cycle(cycle, quantity, side, unit, here.time, sign * shown * value[:, k], shown * sd[:, k])
        if np.isfinite(one.value).mean() > _ENOUGH:
            yield one


def _rows(body: Body, regressor: Array, given: Array, rates: Array) -> tuple[Array, Array, list[str], list[str]]:
    """Return moments, then powers: rows (T, m, 10N) and what the ground gives (T, m), so that value = rows phi - given;
    names with side; units.
    """
    groups = [list(chain) for chain in chains(body)]
    power = [np.einsum("tj,tjp->tp", rates[:, axes], regressor[:, axes]) for axes in groups]
    done = [np.sum(rates[:, axes] * given[:, axes], axis=1) for axes in groups]
    names = [f"{joint.name}_moment" for joint in body.joints]
    names += [f"{body.joints[axes[-1]].name.rpartition('_')[0]}_power" for axes in groups]
    units = ["N·m/kg"] * len(body.joints) + ["W/kg"] * len(groups)
    return (
        np.concatenate([regressor, np.stack(power, axis=1)], axis=1),
        np.concatenate([given, np.stack(done, axis=1)], axis=1),
        names,
        units,
    )


def _is_known(joint: str, known: Mapping[str, NDArray[np.bool_]], motion: Motion) -> NDArray[np.bool_]:
    """Return (T,) where the ground's share about a joint is known: a leg needs its own foot, trunk and arms nothing."""
    side, name = side_and_name(joint)
    return known[side] if name.startswith(("hip", "knee", "ankle")) else motion.determined


def _frames(motion: Motion, chosen: NDArray[np.bool_]) -> Motion:
    """Return some frames of a motion."""
    cut = {name: getattr(motion, name)[chosen] for name in ("time", "q", "v", "a", "residual", "determined")}
    return replace(motion, **cut)
