"""How observations respond to every parameter of every cause is what they show of altered recordings."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from altered_recordings import altered, differences
from walking import FOOT, MASS, session, standing, walk

from biodance.diagnosis.witness_evidence import ObservedEvidence, collect_evidence
from biodance.lab.session.read import read_session
from biodance.observations import SeenTrial, observe, recording, sensitivities
from biodance.records import CHANNELS, Array, Session

PAIRS = [f"{a}->{b}" for a in CHANNELS for b in CHANNELS if a != b]
PLATE = [
    *(("plate_position", axis, "shift", 1e-4, 0.004) for axis in "xyz"),
    *(("plate_rotation", axis, "angle", 1e-4, 0.02) for axis in "xyz"),
    *(("plate_offset", name, "offset", 1e-3, 2.0 if name in CHANNELS[:3] else 0.5) for name in CHANNELS),
    *(("plate_gain", name, "gain", 1e-5, 0.02) for name in CHANNELS),
    *(("plate_crosstalk", pair, "ratio", 1e-5, 0.004 if pair[0] == "F" else 0.02) for pair in PAIRS),
]
"""Effect, where, parameter, a step so small that no sample enters or leaves a stance, and a small fault."""
STEPWISE = {"force_end"}
"""What is seen sample by sample: between the samples a small step shows nothing."""


Seen = tuple[SeenTrial, ...]


def seen_in(found: Session) -> Seen:
    return tuple(recording(trial, mass=found.subject.mass) for trial in found.trials)


def both(recorded: Seen, effect: str, target: str, parameter: str, step: float) -> tuple[Array, Array, list[str]]:
    """Return the sensitivities and the differences of all observations over their sd, and who observed."""
    out = []
    for seen in recorded:
        before = observe(seen)
        told = sensitivities(seen, before, effect, target, parameter)
        made = differences(seen, before, effect, target, step)
        out += [(a / o.sd, b / o.sd, o.observer) for a, b, o in zip(told, made, before, strict=True)]
    told, made, who = zip(*out, strict=True)
    return np.array(told), np.array(made), list(who)


@pytest.fixture(scope="module")
def real(data: Path) -> Session:
    """One walk over two plates and quiet standing."""
    found = read_session(data / "biomechzoo/HC030A")
    return replace(found, trials=found.trials[:2])


@pytest.fixture(scope="module")
def seen(real: Session) -> Seen:
    return seen_in(real)


@pytest.mark.parametrize("of", sorted({effect for effect, *_ in PLATE}))
def test_plates_of_a_real_walk(of: str, seen: Seen) -> None:
    for effect, where, parameter, step, small in PLATE:
        if effect == of:
            told, made, who = both(seen, effect, f"plate1:{where}", parameter, step)
            known = np.array([name not in STEPWISE for name in who]) & np.isfinite(made)
            assert known.sum() > 0.8 * len(who)
            np.testing.assert_allclose(small * told[known], small * made[known], atol=2e-3, err_msg=where)


def test_a_force_that_ends_on_a_slope_ends_later_where_it_reads_more() -> None:
    """20 N of a force that falls by 600 N in 0.12 s: a newton is 0.2 ms; a cosine of steps of 1 ms shows 6 N."""
    trial = walk()
    bare = [replace(plate, decisions=()) for plate in trial.plates]
    bare_one = seen_in(session(replace(trial, plates=tuple(bare))))
    told, made, who = both(bare_one, "plate_offset", "plate1:Fz", "offset", 12.0)
    ends = [k for k, name in enumerate(who) if name == "force_end" and told[k]]
    assert len(ends) == 1
    np.testing.assert_allclose(told[ends], made[ends], rtol=0.1)


@pytest.mark.parametrize("real_one", [True, False])
def test_late_forces(real_one: bool, seen: Seen) -> None:
    """Of 4 ms, within a tenth of what one observation errs by: markers are known every 10 ms."""
    found = seen if real_one else seen_in(session(standing(), walk()))
    told, made, who = both(found, "time_delay", "", "delay", 0.004)
    known = np.isfinite(made)
    assert known.sum() > 0.8 * len(who)
    assert np.abs(0.004 * told).max() > 0.5
    np.testing.assert_allclose(0.004 * told[known], 0.004 * made[known], atol=0.1)


def test_a_runner_on_a_belt(data: Path) -> None:
    """Steps on one plate that moves: late forces lie farther ahead by what the belt goes."""
    found = read_session(data / "rbds/S001")
    running = seen_in(replace(found, trials=found.trials[:1]))
    for effect, target, parameter, step, small in (
        ("time_delay", "", "delay", 0.004, 0.004),
        ("plate_rotation", "plate1:z", "angle", 1e-4, 0.02),
        ("plate_crosstalk", "Fz->My", "ratio", 1e-5, 0.004),
        ("body_mass", "", "error", 0.01, 0.5),
    ):
        told, made, who = both(running, effect, target, parameter, step)
        known = np.isfinite(made)
        assert known.sum() > 0.8 * len(who)
        assert told.any()
        np.testing.assert_allclose(small * told[known], small * made[known], atol=0.1)


def test_a_person_heavier_than_declared(seen: Seen) -> None:
    told, made, _ = both(seen, "body_mass", "", "error", 0.01)
    assert told.any()
    np.testing.assert_allclose(told, made, atol=1e-6)


@pytest.mark.parametrize(
    ("marker", "direction", "parameter"), [("TOE", (0.0, 1.0), "inwards"), ("HEE", (-1.0, 0.0), "backwards")]
)
def test_markers_beside_where_they_are_expected(marker: str, direction: tuple[float, float], parameter: str) -> None:
    """The walk goes along x: of the right foot y is inwards, -x backwards."""
    trial, size = walk(outwards=0.004), 1e-3
    xyz = np.array(trial.markers.xyz)
    xyz[:, trial.markers.names.index(f"R{marker}"), :2] += size * np.array(direction)
    moved = recording(replace(trial, markers=replace(trial.markers, xyz=xyz)), mass=MASS)
    seen = recording(trial, mass=MASS)
    found = observe(seen, ["foot_across", "foot_along"])
    after = {one.key: one.value - one.expected for one in observe(moved, ["foot_across", "foot_along"])}
    made = [(after[one.key] - one.value + one.expected) / size for one in found]
    told = sensitivities(seen, found, "toe_landmark", "right", parameter)
    assert np.abs(told).max() > 0.5
    np.testing.assert_allclose(told, made, atol=2 * size / FOOT)


def test_columns_are_of_every_effect_and_parameter() -> None:
    evidence = collect_evidence(session(standing(), walk()))
    two = evidence.columns("plate_position", "plate1:y", ("shift", "nothing"))
    assert two.shape == (len(evidence.observations), 2)
    np.testing.assert_array_equal(two[:, 0], evidence.sensitivities["plate_position", "plate1:y"])
    assert not two[:, 1].any()
    assert evidence.columns("plate_gain", "plate1:Mx", ("gain",)).any()
    assert not evidence.columns("joint_centre", "hip", ("x", "y", "z")).any()
    assert not evidence.columns("plate_gain", "plate9:Fz", ("gain",)).any()
    load = evidence.columns("added_mass", "thigh", ("mass", "place_x"))
    np.testing.assert_array_equal(load[:, :1], evidence.columns("body_mass", "", ("error",)))
    sides = [evidence.columns("toe_landmark", side, ("inwards",)) for side in ("left", "right", "both")]
    np.testing.assert_array_equal(sides[0] + sides[1], sides[2])
    assert sides[0].any()


def test_the_sign_of_a_channel_is_turned_in_all_that_counts(real: Session) -> None:
    evidence = collect_evidence(real)
    for (effect, target), value in evidence.sign_reversed.items():
        name, _, channel = target.rpartition(":")
        made = turned(evidence, name, channel)
        counts = np.array([one.counts for one in evidence.observations])
        assert effect == "axis_error"
        assert np.isnan(value[~counts]).all()
        np.testing.assert_allclose(value[counts], made[counts], atol=1e-9)


def turned(evidence: ObservedEvidence, name: str, channel: str) -> Array:
    """Return value minus expectation after a channel is multiplied by -1; of Fz all others are."""
    channels = [one for one in CHANNELS if (one == channel) is not (channel == "Fz")]
    out = np.array([one.value - one.expected for one in evidence.observations])
    for seen in evidence.recorded:
        right = seen
        for one in channels if seen.steps else ():
            right = altered(right, "plate_gain", f"{name}:{one}", -2.0)
        after = {one.key: one.value - one.expected for one in observe(right)}
        for k, one in enumerate(evidence.observations):
            if one.trial == seen.trial.name:
                out[k] = after.get(one.key, np.nan)
    return out
