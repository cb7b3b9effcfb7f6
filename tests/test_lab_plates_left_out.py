"""What of force plates is no measurement: padding at the ends, dead plates; and data that are scaled already."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from c3d_files import File, real, text, whole
from effect_cases import failed
from lab_sessions import GRAVITY, PLUG_IN_GAIT, person
from plate_emulator import RATE, Emulated, channels, raw_file

from biodance.effects import Recorded, check_quality
from biodance.lab.inspect import inspect_file
from biodance.lab.markers.upright import standing_mass
from biodance.lab.plates.read import read_plates
from biodance.lab.readers.c3d import read_c3d
from biodance.records import Markers, Session, Source, Subject, Trial

MASS, SECONDS = 64.0, 4.0
TIME = np.arange(0, SECONDS, 1 / RATE)
FEET = [Emulated(centre=np.array([0.05, y, 0.0]), half=np.array([0.3, 0.103])) for y in (0.105, -0.105)]
"""A plate under the left foot of `person`, one under the right."""
AWAY = Emulated(centre=np.array([1.0, 0.0, 0.0]))


def loads(*, squat: float = 0.0, seed: int = 0) -> list[np.ndarray]:
    """Return the wrench (S, 6) on each plate of `FEET`: half the weight at the foot, which sways by 3 mm and squats by
    a share of the weight.
    """
    rng = np.random.default_rng(seed)
    found = []
    for one in FEET:
        wave = np.sin(2 * np.pi * (0.8 * TIME + rng.uniform()))
        up = 0.5 * MASS * GRAVITY * (1 + squat * wave) + rng.normal(0, 0.5, TIME.size)
        force = np.stack([2 * wave, rng.normal(0, 0.3, TIME.size), up], axis=1)
        point = one.centre + np.stack([0.003 * np.cos(2 * np.pi * 0.7 * TIME), 0.002 * wave, 0 * wave], axis=1)
        found.append(np.hstack([force, np.cross(point, force)]))
    return found


def markers(*, moving: bool = False) -> Markers:
    """Return somebody with one foot on each plate of `FEET`, noise 0.5 mm, who bends by 0.1 m where ``moving``."""
    seen = person(frames=int(SECONDS * 100), rate=100.0)
    bent = np.where(seen.xyz[..., 2] > 0.2, 0.05 * np.sin(2 * np.pi * 0.8 * seen.time)[:, None], 0.0)
    return replace(seen, xyz=seen.xyz + moving * np.stack([0 * bent, 0 * bent, bent], axis=2))


def write(path: Path, analog: np.ndarray, seen: Markers, *, scale: np.ndarray | None = None) -> Path:
    """Write the markers and the channels (S, 12) in N and N mm of the plates `FEET` as floats; return the path."""
    points = np.concatenate([1000 * seen.xyz, np.zeros((*seen.xyz.shape[:2], 1))], axis=2)
    group = {
        "USED": whole(2),
        "TYPE": whole(2, 2),
        "ZERO": whole(1, 0),
        "CHANNEL": whole(*range(1, 13), shape=(6, 2)),
        "ORIGIN": real(*np.ravel([1000 * one.origin for one in FEET]), shape=(3, 2)),
        "CORNERS": real(*np.ravel([1000 * one.corners for one in FEET]), shape=(3, 4, 2)),
    }
    units = {"UNITS": text(*(["N"] * 3 + ["Nmm"] * 3) * 2), "SCALE": real(*np.ones(12) if scale is None else scale)}
    said = {"POINT": {"LABELS": text(*PLUG_IN_GAIT)}, "ANALOG": units, "FORCE_PLATFORM": group}
    said["PROCESSING"] = {"BODYMASS": real(MASS)}
    path.write_bytes(File(points, analog, rate=100.0, parameters=said).bytes())
    return path


def on_disk(truth: list[np.ndarray]) -> np.ndarray:
    """Return the channels (S, 12) of the plates `FEET` in N and N mm."""
    recorded = np.hstack([channels(one, value) for one, value in zip(FEET, truth, strict=True)])
    return recorded * np.array([1.0, 1.0, 1.0, 1e3, 1e3, 1e3] * 2)


def session_of(*trials: Trial) -> Session:
    return Session(Subject(MASS, 1.70, "F"), trials, Path())


@pytest.fixture
def padded(tmp_path: Path) -> Trial:
    """Squats whose first 30 and last 20 ms repeat one sample; the moments end at their largest there, as by chance."""
    analog = on_disk(loads(squat=0.3))
    analog[:15], analog[-10:] = analog[15], analog[-11]
    return read_c3d(write(tmp_path / "squat_1.c3d", analog, markers(moving=True)))


def test_padding_at_both_ends_is_left_out_and_said_once(padded: Trial) -> None:
    (said,) = [line for line in (*padded.history, *padded.warnings) if "padding" in line]
    record = inspect_file(padded.source.path)
    assert (record["status"], record["reason"]) == ("warning", said)
    assert said == (
        "The first 30 ms and the last 20 ms of every analog channel repeat one sample: padding by the recording "
        "program. They were left out."
    )
    truth = loads(squat=0.3)
    for plate, value in zip(padded.plates, truth, strict=True):
        assert np.isnan(plate.wrench.value[:15]).all()
        assert np.isnan(plate.wrench.value[-10:]).all()
        np.testing.assert_allclose(plate.wrench.value[15:-10], value[15:-10], atol=1e-3)


def test_padding_is_named_and_no_channel_called_clipped(padded: Trial) -> None:
    found = check_quality(Recorded(session_of(padded)), chosen=("padding", "clipping"))
    assert failed(found) == [("padding", "")]
    (one,) = [quality for quality in found if not quality.ok]
    assert one.size == pytest.approx(0.05)
    assert "(squat_1)" in one.text
    assert one.mended, "it is out of the recording already, and the rest can be judged"
    assert np.isnan(padded.plates[0].wrench.value[:15]).all()


def test_what_repeats_for_another_reason_is_no_padding() -> None:
    truth, seen = loads(squat=0.3), markers(moving=True)
    signals = [channels(one, value) for one, value in zip(FEET, truth, strict=True)]

    def defects(changed: list[np.ndarray], worn: Markers) -> tuple:
        return read_plates(raw_file(FEET, changed), metres=0.001, markers=worn).defects

    zeroed = [np.where(TIME[:, None] < 0.5, 0.0, signal) for signal in signals]
    assert defects(zeroed, seen) == ()  # a plate that its program sets to zero while nobody is on it
    computed = [np.where(TIME[:, None] < 0.5, signal[250], signal) for signal in signals]
    rests = np.where(seen.time[:, None, None] < 0.52, seen.xyz[52], seen.xyz)
    assert defects(computed, replace(seen, xyz=rests)) == ()  # a posture that was computed: the markers rest, too
    constant = [np.tile(signal[:1], (TIME.size, 1)) for signal in signals]
    assert {one.effect for one in defects(constant, seen)} == {"dead_plate"}
    short = [np.where(np.arange(TIME.size)[:, None] < 3, signal[3], signal) for signal in signals]
    assert defects(short, seen) == ()
    assert [one.effect for one in defects(computed, seen)] == ["padding"]


def three_plates(dead: float, *, squat: float, reaction: bool = False) -> tuple:
    """Return a file with the plates `FEET` and a third one, beside the person, that reads ``dead`` N along its z with
    noise of 3 N, and the truth.
    """
    plates = [replace(one, reaction=reaction) for one in FEET]
    truth = loads(squat=squat)
    signals = [channels(one, value) for one, value in zip(plates, truth, strict=True)]
    noise = np.random.default_rng(7).normal(0, 1, (TIME.size, 6)) * [3.0, 3.0, 3.0, 0.3, 0.3, 0.3]
    return raw_file([*plates, AWAY], [*signals, noise + np.array([0, 0, dead, 0, 0, 0])]), truth


@pytest.mark.parametrize("reaction", [False, True])
@pytest.mark.parametrize("dead", [-975.0, 975.0])
@pytest.mark.parametrize("squat", [0.0, 0.3])
def test_a_dead_plate_is_named_and_turns_no_other_round(dead: float, squat: float, reaction: bool) -> None:
    """-975 N with nobody on it, as a clinic's third plate reads: neither sign nor zero of any plate comes from it."""
    raw, truth = three_plates(dead, squat=squat, reaction=reaction)
    seen = markers(moving=squat > 0)
    plates, warnings, history, defects = read_plates(raw, metres=0.001, markers=seen, body_mass=MASS)
    assert [plate.name for plate in plates] == ["plate1", "plate2"]
    for plate, value in zip(plates, truth, strict=True):
        np.testing.assert_allclose(plate.wrench.value, value, atol=1e-6)
    (one,) = defects
    assert (one.effect, one.target, one.unit) == ("dead_plate", "plate3", "N")
    assert one.size == pytest.approx(dead, abs=0.5)
    assert (warnings, history) == ((), (one.text,))
    assert one.text.startswith("Plate 3 was left out, and what it carried is missing from the total: it reads")
    trial = Trial("squat", "fit", markers(), plates, Source(Path("squat.c3d"), "", "C3D", 100.0, RATE), defects=defects)
    found = [quality for quality in check_quality(Recorded(session_of(trial))) if quality.effect == "dead_plate"]
    assert [(quality.target, quality.ok, quality.mended) for quality in found] == [("plate3", False, True)]


def test_the_offset_of_a_plate_beside_the_person_is_its_zero() -> None:
    raw, truth = three_plates(32.0, squat=0.3)
    plates, warnings, _, defects = read_plates(raw, metres=0.001, markers=markers(moving=True))
    assert (len(plates), warnings, defects) == (3, (), ())
    assert abs(plates[2].wrench.value[:, 2].mean()) < 0.1
    assert abs(plates[2].zero[2]) == pytest.approx(32.0, abs=0.5)
    assert (
        "Zero: no foot is ever on the plate, so the constant 32 N that it reads was subtracted." in plates[2].decisions
    )
    for plate, value in zip(plates, truth, strict=False):
        np.testing.assert_allclose(plate.wrench.value, value, atol=1e-6)


def test_nobody_is_on_a_plate_only_where_feet_are_seen_on_another() -> None:
    """Standing on plates whose corners are 3 m off: the feet are on none, so nothing is told from them."""
    far = [replace(one, centre=one.centre + np.array([3.0, 0, 0])) for one in FEET]
    moved = [np.hstack([w[:, :3], w[:, 3:] + np.cross([3.0, 0, 0], w[:, :3])]) for w in loads()]
    signals = [channels(one, value) for one, value in zip(far, moved, strict=True)]
    plates, _, _, defects = read_plates(raw_file(far, signals), metres=0.001, markers=markers())
    assert defects == ()
    assert sum(plate.wrench.value[:, 2].mean() for plate in plates) == pytest.approx(MASS * GRAVITY, rel=1e-3)


def test_somebody_who_stands_like_a_statue_is_no_dead_plate() -> None:
    still = [np.tile(wrench.mean(axis=0), (TIME.size, 1)) for wrench in loads()]
    noise = np.random.default_rng(3).normal(0, 0.2, (TIME.size, 6)) * [1, 1, 1, 0.05, 0.05, 0.05]
    signals = [channels(one, value) + noise for one, value in zip(FEET, still, strict=True)]
    plates, _, _, defects = read_plates(raw_file(FEET, signals), metres=0.001, markers=markers())
    assert (len(plates), defects) == (2, ())


def test_a_real_walk_with_an_untared_plate_has_one_sign(data: Path) -> None:
    """Four plates, one of which reads 32 N throughout with nobody on it; its sign was taken from that."""
    record = inspect_file(data / "gaitalytics" / "test_small.c3d")
    assert not [line for line in record["warnings"] if "Two signs" in line or "Plate 3" in line]
    assert record["plates"][2]["zero_n"][2] == pytest.approx(-31.7, abs=0.1)
    assert abs(record["plates"][2]["mean_vertical_n"]) < 0.1


def test_a_scale_with_which_the_person_weighs_tonnes_was_applied_already(tmp_path: Path) -> None:
    truth = loads()
    trial = read_c3d(write(tmp_path / "static.c3d", on_disk(truth), markers(), scale=np.full(12, 1e3)))
    for plate, value in zip(trial.plates, truth, strict=True):
        np.testing.assert_allclose(plate.wrench.value, value, atol=1e-3)
    assert "SCALE was not applied" in trial.warnings[0]


@pytest.mark.parametrize("squat", [0.0, 0.3])
def test_data_that_are_scaled_already_are_told_by_the_weight(tmp_path: Path, squat: float) -> None:
    scale = np.array([0.05, 0.05, 0.1, 25.0, 25.0, 20.0] * 2)
    truth = loads(squat=squat)
    trial = read_c3d(write(tmp_path / "static.c3d", on_disk(truth), markers(moving=squat > 0), scale=scale))
    for plate, value in zip(trial.plates, truth, strict=True):
        np.testing.assert_allclose(plate.wrench.value, value, atol=1e-3)
    (said,) = trial.warnings
    assert said.startswith("Read with ANALOG:SCALE the plates carry 0.1 of the weight (64 kg), without it all of it (")
    assert "): the floating-point data are already scaled, and SCALE was not applied." in said
    if not squat:
        assert standing_mass(trial) == pytest.approx(MASS, rel=1e-3)
    assert failed(check_quality(Recorded(session_of(trial)), chosen=("unit_error",))) == []


def test_a_scale_that_is_needed_is_applied(tmp_path: Path) -> None:
    scale = np.array([0.05, 0.05, 0.1, 25.0, 25.0, 20.0] * 2)
    truth = loads()
    trial = read_c3d(write(tmp_path / "static.c3d", on_disk(truth) / scale, markers(), scale=scale))
    np.testing.assert_allclose(trial.plates[0].wrench.value, truth[0], atol=1e-3)
    assert trial.warnings == ()
    light = read_c3d(write(tmp_path / "light.c3d", 0.4 * on_disk(truth) / scale, markers(), scale=scale))
    assert not [line for line in light.warnings if "already scaled" in line]
    assert light.plates[0].wrench.value[:, 2].mean() == pytest.approx(0.4 * truth[0][:, 2].mean(), rel=1e-3)
