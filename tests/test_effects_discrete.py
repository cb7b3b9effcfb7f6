"""Data-quality checks: what is wrong or right, found on recordings whose fault is known, and nothing found on those
without.
"""

import importlib
import re
import sys
from dataclasses import astuple, replace
from pathlib import Path

import numpy as np
import pytest
from effect_cases import failed, session_of
from human_cases import CORNERS, human_case

import biodance.effects as family
from biodance.effects import (
    Case,
    DiscreteEffect,
    Recorded,
    check_quality,
    discrete_effects,
    effect,
    effects,
    wrench_about_origin,
    wrench_about_point,
)
from biodance.effects.axis_error import sign_turned
from biodance.effects.unit_error import FACTORS
from biodance.errors import BiodanceError, UnknownName
from biodance.motion.kinematics import poses
from biodance.motion.track import track
from biodance.records import Array, Markers, Plate, Session, Source, Subject, Trial, Wrench

MASS = 70.0


def standing(rng: np.random.Generator, *, seconds: float = 10.0, rate: float = 1000.0) -> Array:
    """Return a wrench (S, 6) about the lab origin of somebody who sways on the plate, with the noise of an
    amplifier.
    """
    time = np.arange(int(seconds * rate)) / rate
    sway = 0.02 * np.stack([np.sin(2 * np.pi * 0.3 * time), np.cos(2 * np.pi * 0.4 * time)], axis=1)
    force = np.stack(
        [5 * np.sin(2 * time), 4 * np.cos(3 * time), MASS * 9.80665 + 40 * np.sin(2 * np.pi * 0.6 * time)], axis=1
    )
    point = np.hstack([CORNERS.mean(axis=0)[:2] + sway, np.zeros((time.size, 1))])
    return np.hstack([force, np.cross(point, force)]) + rng.normal(0, 0.3, (time.size, 6))


def recorded(
    value: Array, *, rate: float = 1000.0, decisions: tuple[str, ...] = (), warnings: tuple[str, ...] = ()
) -> Recorded:
    """Return a session of one trial on one plate."""
    time = np.arange(len(value)) / rate
    plate = Plate("plate1", 2, CORNERS, Wrench(time, value), decisions)
    trial = Trial("stand", "fit", None, (plate,), Source(Path("stand.c3d"), "", "C3D"), warnings=warnings)
    return Recorded(Session(Subject(MASS, 1.75, "M"), (trial,), Path()))


def on_plate(case: Case, change: Array) -> Case:
    """Return the case whose plate's wrench about its centre is multiplied by ``change`` (6,)."""
    plate = case.trial.plates[0]
    value = wrench_about_origin(wrench_about_point(plate.wrench.value, plate.centre) * change, plate.centre)
    return replace(case, trial=replace(case.trial, plates=(replace(plate, wrench=Wrench(plate.wrench.time, value)),)))


@pytest.mark.parametrize("name", sorted(discrete_effects()))
def test_every_discrete_effect_says_what_it_is(name: str) -> None:
    kind = discrete_effects()[name]
    assert kind.name == name
    assert isinstance(kind, DiscreteEffect)
    assert kind.separated_by.endswith(".")
    assert len(kind.advice) > 20
    assert all(sentence.endswith(".") for sentence in astuple(kind.about)), name
    assert kind.words is not None


def test_nothing_is_found_where_nothing_is_wrong() -> None:
    value = standing(np.random.default_rng(0))
    found = check_quality(recorded(value))
    assert failed(found) == []
    assert {quality.check for quality in found} == {"range of the channels", "mains hum", "weight on the plates"}
    moving = human_case(600)
    found = check_quality(Recorded(session_of(moving).session, (moving, moving)))
    assert failed(found) == []
    assert {quality.check for quality in found} >= {
        "signs of the channels",
        "rate of the cameras",
        "lost frames",
        "labels of the markers",
    }


@pytest.mark.parametrize("factor", FACTORS)
def test_a_known_factor_is_named(factor: float) -> None:
    found = discrete_effects()["unit_error"].check(recorded(factor * standing(np.random.default_rng(1))))
    assert failed(found) == [("unit_error", "")]
    assert found[0].size == pytest.approx(factor)


@pytest.mark.parametrize("share", [0.5, 0.7, 1.04, 1.2])
def test_a_foot_beside_the_plate_is_no_unit(share: float) -> None:
    assert failed(discrete_effects()["unit_error"].check(recorded(share * standing(np.random.default_rng(2))))) == []


def test_the_share_of_the_weight_is_told_with_its_trials() -> None:
    """Of three trials a walk with 0.94 of the weight: no median that belongs to nobody, beside a standing of 1.00."""
    stand = recorded(standing(np.random.default_rng(3))).session
    walk, late = (
        replace(recorded(share * standing(np.random.default_rng(4))).session.trials[0], name=name)
        for name, share in (("walk", 0.94), ("late", 0.97))
    )
    (told,) = discrete_effects()["unit_error"].check(Recorded(replace(stand, trials=(*stand.trials, walk, late))))
    assert told.ok
    assert re.search(r"carry 0\.94\d? \(walk\) to (?:1|0\.99\d|1\.0\d) \(stand\) times the declared weight", told.text)
    assert "while loaded" in told.text
    (alone,) = discrete_effects()["unit_error"].check(Recorded(stand))
    assert re.search(r"carry \S+ \(stand\) times the declared weight", alone.text)


def test_what_the_reader_overruled_is_told() -> None:
    said = (
        "The moments put the load on the plate only when taken 1000 times as large as the file's units say; that was "
        "done.",
        "The load lies 0.31 m from the feet that the markers show, and under them when the corners are counted from "
        "another one: "
        "the plate axes were turned by 90 degrees.",
    )
    unit = "POINT:UNITS is 'furlong'; a cloud of markers of 1723 can only be in mm, so lengths are in mm."
    found = check_quality(recorded(standing(np.random.default_rng(3)), decisions=said, warnings=(unit,)))
    assert failed(found) == [("axis_error", "plate1:axes"), ("unit_error", "markers"), ("unit_error", "plate1:moments")]
    assert sorted(quality.size for quality in found if quality.size > 0) == [90, 1000]


def test_one_unit_is_one_cause_though_every_trial_tells_its_own_number() -> None:
    said = (f"POINT:UNITS is 'mm'; a cloud of markers of {size} can only be in m, so lengths are in m." for size in
            ("1.431", "1.445", "1.545"))  # fmt: skip
    found = check_quality(recorded(standing(np.random.default_rng(3)), warnings=tuple(said)))
    assert failed(found) == [("unit_error", "markers")]
    assert "1.431" in next(one.text for one in found if not one.ok)


@pytest.mark.parametrize(("channel", "target"), [(1, "Fy"), (3, "Mx"), (5, "Mz")])
def test_a_mirrored_channel_is_named(channel: int, target: str) -> None:
    sign = np.ones(6) - 2 * np.eye(6)[channel]
    found = discrete_effects()["axis_error"].check(session_of(on_plate(human_case(), sign)))
    assert failed(found) == [("axis_error", target)]


@pytest.mark.parametrize(("share", "told"), [(0.02, ("Fx",)), (2.0, ())])
def test_no_sign_is_told_that_hangs_on_how_the_mass_is_shared(share, told) -> None:
    """Who bows fast moves trunk and pelvis against each other: 10 N are left of them, either way."""
    needed = np.zeros((200, 6))
    needed[:, 0] = 10 * np.sin(np.arange(200))
    doubt = np.stack([share * needed, np.zeros_like(needed)], axis=2)
    noise = np.random.default_rng(5).normal(size=needed.shape)
    assert sign_turned(noise - needed, needed, doubt) == told


@pytest.mark.parametrize(("channel", "target", "limit"), [(2, "Fz", 710.0), (3, "Mx", 9.0)])
def test_a_flat_top_is_named_with_its_level(channel: int, target: str, limit: float) -> None:
    local = wrench_about_point(standing(np.random.default_rng(4)), CORNERS.mean(axis=0))
    local[:, channel] = np.clip(local[:, channel], -limit, limit)
    found = discrete_effects()["clipping"].check(recorded(wrench_about_origin(local, CORNERS.mean(axis=0))))
    assert failed(found) == [("clipping", target)]
    assert found[0].size == pytest.approx(limit, rel=1e-3)
    assert (found[0].quantity, found[0].unit) == ("limit", "N" if channel < 3 else "N·m")


def test_coarse_converters_empty_plates_and_filled_ends_do_not_clip() -> None:
    """A file that was shifted in time repeats its first values, which may be the largest of a hardly used plate."""
    value = standing(np.random.default_rng(5))
    coarse = np.round(value / 4) * 4
    stepped_off = np.where((np.arange(len(value)) > 6000)[:, None], 0.0, value)
    falling = value * np.linspace(2.0, 1.0, len(value))[:, None]
    filled = np.concatenate([np.tile(falling[:1] * 1.1, (30, 1)), falling[:-30]])
    for fine in (coarse, stepped_off, filled, filled[::-1]):
        assert failed(discrete_effects()["clipping"].check(recorded(fine))) == []


@pytest.mark.parametrize("frequency", [50.0, 60.0])
def test_hum_is_named_with_its_amplitude(frequency: float) -> None:
    local = wrench_about_point(standing(np.random.default_rng(6)), CORNERS.mean(axis=0))
    local[:, 0] += 5 * np.sin(2 * np.pi * frequency * np.arange(len(local)) / 1000)
    value = wrench_about_origin(local, CORNERS.mean(axis=0))
    found = discrete_effects()["mains_hum"].check(recorded(value))
    assert failed(found) == [("mains_hum", "Fx")]
    assert found[0].size == pytest.approx(5, rel=0.05)
    once = recorded(value)
    quiet = replace(
        once.session.trials[0], plates=recorded(standing(np.random.default_rng(8))).session.trials[0].plates
    )
    single = Recorded(replace(once.session, trials=(once.session.trials[0], quiet, quiet)))
    assert failed(discrete_effects()["mains_hum"].check(single)) == [], "a glitch in one trial is no hum"
    slow = discrete_effects()["mains_hum"].check(recorded(value[::10], rate=100.0))
    assert slow == (), "100 Hz cannot show it"


@pytest.mark.parametrize("lines", [(59.7,), tuple(np.arange(44.0, 68.0, 3.2))], ids=["a motor", "a runner's steps"])
def test_a_line_beside_the_mains_and_a_comb_of_steps_are_no_hum(lines: tuple[float, ...]) -> None:
    local = wrench_about_point(standing(np.random.default_rng(6), seconds=20.0), CORNERS.mean(axis=0))
    for frequency in lines:
        local[:, 4] += 2 * np.sin(2 * np.pi * frequency * np.arange(len(local)) / 1000)
    value = wrench_about_origin(local, CORNERS.mean(axis=0))
    assert failed(discrete_effects()["mains_hum"].check(recorded(value))) == []


@pytest.mark.parametrize("pair", [("LKNE", "RKNE"), ("LELB", "RELB")])
def test_swapped_labels_are_named(pair: tuple[str, str]) -> None:
    case = human_case(120)
    markers = case.trial.markers
    assert markers is not None
    other = {pair[0]: pair[1], pair[1]: pair[0]}
    swapped = Markers(tuple(other.get(name, name) for name in markers.names), markers.time, markers.xyz)
    static = replace(case.trial, name="static", role="static", markers=swapped)
    found = discrete_effects()["labels_swapped"].check(Recorded(Session(Subject(MASS, 1.75, "M"), (static,), Path())))
    assert failed(found) == [("labels_swapped", "/".join(pair))]
    trial = replace(case.trial, markers=swapped)
    wrong = replace(case, trial=trial, motion=track(case.body, trial))
    found = discrete_effects()["labels_swapped"].check(session_of(wrong))
    assert failed(found) == [("labels_swapped", "/".join(pair))]


@pytest.mark.parametrize("side", ["L", "R"])
def test_a_turned_wrist_is_named_in_the_static_trial(side: str) -> None:
    body = human_case(120).body
    q = np.tile(body.neutral, (20, 1))
    xyz = poses(body, q).points(body.markers.segment, body.markers.position)
    other = {f"{side}WRA": f"{side}WRB", f"{side}WRB": f"{side}WRA"}
    names = body.markers.names
    for labels, expected in (
        (names, []),
        (tuple(other.get(n, n) for n in names), [("labels_swapped", f"{side}WRA/{side}WRB")]),
    ):
        markers = Markers(labels, np.arange(20) / 100, xyz)
        static = Trial("static", "static", markers, (), Source(Path("static.c3d"), "", "C3D"))
        found = discrete_effects()["labels_swapped"].check(
            Recorded(Session(Subject(MASS, 1.75, "M"), (static,), Path()))
        )
        assert failed(found) == expected


@pytest.mark.parametrize(
    ("module", "base", "missing"),
    [
        ("quality_check", "DiscreteEffect", "check"),
        ("missing_joint", "MissingJoint", "extended_body"),
        ("effect", "Effect", "columns or transform"),
    ],
)
def test_a_file_that_leaves_out_what_its_author_must_write_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, module: str, base: str, missing: str
) -> None:
    text = (
        f"from biodance.effects._base.{module} import {base}\n\n\nclass Blind({base}):\n    name = "
        f"'blind'\n\n\nEFFECT = Blind\n"
    )
    (tmp_path / "blind.py").write_text(text, encoding="utf-8")
    monkeypatch.setattr(family, "__path__", [*family.__path__, str(tmp_path)])
    importlib.invalidate_caches()
    with pytest.raises(BiodanceError, match=rf"blind\.py: lacks {missing}, so it is no effect\. Write what is missing"):
        effects()
    sys.modules.pop("biodance.effects.blind", None)


def test_the_library_can_lack_an_effect() -> None:
    names = [name for name in effects() if name != "plate_gain"]
    assert "plate_gain" not in effects(names)
    assert list(effects(names)) == names
    assert list(discrete_effects(("clipping",))) == ["clipping"]
    assert {
        quality.effect for quality in check_quality(recorded(standing(np.random.default_rng(7))), chosen=("mains_hum",))
    } <= {"", "mains_hum"}
    with pytest.raises(UnknownName, match="plate_gain"):
        effects(("plate_gian",))
    with pytest.raises(UnknownName):
        effect("clipping")
