"""The one sentence that every session begins with: short, with one thing to do, in plain words, wherever it is told."""

import itertools
import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from example_results import LEFT, VERDICTS

from biodance.diagnosis.accept import Gain
from biodance.diagnosis.diagnosis import Alias, Diagnosis, Estimate, Finding
from biodance.diagnosis.reasons import DOUBTS, STRANGE, DiagnosisStatus, Reason
from biodance.effects import QualityCheck, causes
from biodance.pipeline.attention import headline
from biodance.records.attention import OTHER_PEOPLE, Attention, Judged

FORBIDDEN = re.compile(
    r"not told from|outside the limit|fully measured|named, (?:in)?complete|unexplained|\{|\}|_|->|\bnan\b|\binf\b"
)
STATIC, WALKED = Judged("static", 3.0), Judged("walk_with_a_long_name_1", 12.3)
STEPS = Judged("walk_2", 1.24, "only by its steps: too short.", missed=True)
MISSED = Judged("S4_AM_Cal_01.c3d", 0.0, "it has no usable force plate.", missed=True)
ROWS = (
    (STATIC, WALKED),
    (STATIC, STEPS),
    (STATIC, MISSED),
    (STATIC, *(replace(MISSED, trial=f"trial_{k}") for k in range(30))),
    (STATIC, STEPS, WALKED),
    (STATIC, STEPS, WALKED, *(replace(MISSED, trial=f"trial_{k}") for k in range(7))),
)
ATTENTION = ((), (Attention("warn", "Look."),), (Attention("note", "Nothing to do."),))
TARGETS = {
    "joint_centre": "left_shoulder", "segment_length": "right_upper_arm", "added_mass": "left_forearm_hand",
    "labels_swapped": "LWRA/RWRA", "marker_misplaced": "R.Heel.Lateral", "external_contact": "right_forearm_hand",
    "lab_tilt": "x", "axis_error": "plate1:corners", "plate_crosstalk": "plate2:Fz->Mx", "plate_position": "plate12:y",
    "plate_rotation": "plate2:z", "time_delay": "plate2", "clipping": "plate2:Fz", "mains_hum": "plate2:Fz",
}  # fmt: skip
PROVEN = Gain(np.ones(6), np.zeros(6), (0.2, 0.4), ("squat",))
ALSO = (
    Alias("plate_crosstalk", "plate2:Fz->Mx", 9.0),
    Alias("body_mass", "", 8.0),
    Alias("my_own_cause", "left_shank", 8.0),
)


def named(effect: str, size: float, others: tuple[Alias, ...]) -> Finding:
    """Return a finding of an effect of the family with a size in the unit of its first parameter."""
    kind = causes().get(effect)
    first = next(iter(getattr(kind, "parameters", ())), None)
    parameters = (Estimate(first.name, size, 0.2 * abs(size), first.unit),) if first else ()
    target = TARGETS.get(
        effect, "plate4:Fz" if effect.startswith("plate") or effect in ("clipping", "mains_hum") else ""
    )
    return Finding(effect, target, parameters, (Alias(effect, target, 30.0), *others), 0.9)


@cache
def found() -> list[Diagnosis]:
    """Return every named cause alone, in a set, among several and beside what is left; every reason for which nobody
    can tell; every other verdict.
    """
    out = list(VERDICTS)
    thigh = "the right thigh is 38 mm longer than the left thigh"
    for effect, size, others in itertools.product({*causes(), "shaking_floor"}, (0.0212, -1234.5), ((), ALSO)):
        one = named(effect, size, others)
        for more, why in itertools.product(((), (named("body_mass", 2.0, ()),) * 7), ({}, {Reason.FORCES_LEFT: ()})):
            out.append(Diagnosis(False, (one, *more), adequacy=LEFT, why=why))
    for reason in Reason:
        for about in (
            (),
            ("forearms", "clavicles"),
            (thigh,),
            ("far " * 40,),
        ):
            out.append(Diagnosis(False, (), adequacy=LEFT, why={reason: about}))
    return out


@pytest.mark.parametrize("judged", ROWS, ids=("whole", "steps", "missed", "many", "all kinds", "all kinds and missed"))
def test_every_headline_is_short_plain_and_has_one_thing_to_do(judged: tuple[Judged, ...]) -> None:
    for one, others in itertools.product(found(), ATTENTION):
        said = headline(one, judged, frozenset({"static"}), others)
        assert 4 <= len(said.text.split()) <= 30, said.text
        assert not FORBIDDEN.search(said.text.replace(MISSED.trial, "")), said.text
        assert "  " not in said.text
        assert not said.text[0].islower()
        sentences = re.findall(r"[^.]+(?:\.\d[^.]*)*\.(?= |$)", said.text)
        well = one.status is DiagnosisStatus.CLEAN and said.level == "note"
        assert len(sentences) == (1 if well else 2) + ("things are wrong. First" in said.text), said.text


@pytest.mark.parametrize(
    ("finding", "told"),
    [
        (
            Finding(
                "time_delay", "plate2", (Estimate("delay", 0.0212, 0.0015, "s"),),
                (Alias("time_delay", "plate2", 9.0),), 1.0, PROVEN,
            ),
            "The forces of plate 2 are 21 ms late (18 to 24). Shift the forces, or accept the correction.",
        ),
        (
            Finding("time_delay", "", (Estimate("delay", -0.0336, 0.0039, "s"),), (Alias("time_delay", "", 9.0),), 1.0),
            "The forces are 34 ms early (26 to 41). Shift the forces.",
        ),
        (
            Finding(
                "plate_gain", "plate4:Fz", (Estimate("gain", -0.24, 0.0065, "1"),),
                (Alias("plate_gain", "plate4:Fz", 9.0), Alias("body_mass", "", 8.0)), 1.0, PROVEN,
            ),
            "Fz of plate 4 reads 24 % too little (23 to 25), or it is a wrong body mass. "
            "Calibrate the plate, or accept the correction.",
        ),
        (
            Finding(
                "marker_misplaced", "RKNE",
                tuple(Estimate(f"shift_{a}", v, 0.004, "m") for a, v in (("x", 0.06), ("y", 0.0), ("z", 0.0))),
                (Alias("marker_misplaced", "RKNE", 9.0),), 1.0,
            ),
            "Marker RKNE sits 60 mm (52 to 68) from its place. Put it back, or leave it out.",
        ),
    ],
)  # fmt: skip
def test_a_cause_is_told_with_its_size_its_interval_and_what_to_do(finding: Finding, told: str) -> None:
    assert headline(Diagnosis(True, (finding,)), (STATIC,), frozenset({"static"})).text == told


def test_exchanged_labels_are_told_in_one_breath() -> None:
    labels = tuple(
        Finding("labels_swapped", f"L{a}/R{a}", (), (Alias("labels_swapped", a, 9.0),), 1.0) for a in ("FIN", "WRA")
    )
    checks = tuple(QualityCheck("labels of the markers", False, "", one.effect, one.target) for one in labels)
    said = headline(Diagnosis(False, labels, checks=checks), (STATIC,), frozenset({"static"}))
    assert (
        said.text == "LFIN and RFIN, LWRA and RWRA carry each other's names. Exchange them, or accept the correction."
    )


def test_files_of_other_people_are_told_before_what_is_said_of_the_rest() -> None:
    strange = Attention("fail", "declares another person.", "b.c3d", OTHER_PEOPLE)
    for one in found():
        said = headline(one, (STATIC, WALKED), frozenset({"static"}), (strange, replace(strange, trial="c.c3d")))
        assert len(said.text.split()) <= 30, said.text
        assert said.level == "fail"
    clean = headline(Diagnosis(True, ()), (STATIC, WALKED), frozenset({"static"}), (strange,)).text
    assert clean.startswith("1 file is of another person, see below. Nothing wrong was found, but")
    shift = named("time_delay", 0.0212, ())
    told = headline(Diagnosis(True, (shift,)), (STATIC,), frozenset({"static"}), (strange, replace(strange, trial="c")))
    assert told.text.startswith("2 files are of other people, see below. The forces of plate 2 are 21 ms late")


def test_a_clean_session_says_what_it_rests_on() -> None:
    clean = Diagnosis(True, ())
    said = headline(clean, (STATIC, WALKED), frozenset({"static"}))
    assert (said.level, said.text) == ("note", "Nothing wrong was found in 3 s of standing and 12 s of movement.")
    stepped = headline(clean, (STATIC, STEPS), frozenset({"static"}))
    assert (stepped.level, stepped.text) == ("note", "Nothing wrong was found in 3 s of standing and 1.2 s of steps.")
    missed = headline(clean, (STATIC, MISSED), frozenset({"static"}))
    assert missed.level == "warn"
    assert "but S4_AM_Cal_01.c3d could not be judged" in missed.text


@pytest.mark.parametrize("reason", list(Reason))
def test_what_a_session_ends_with_follows_from_its_reasons(reason: Reason) -> None:
    one = Diagnosis(False, (), why={reason: ()})
    untold = reason in DOUBTS | STRANGE
    assert (one.status is DiagnosisStatus.CANNOT_TELL) is untold
    assert replace(one, why={reason: (), Reason.LIMIT_BROKEN: ()}).status is DiagnosisStatus.UNKNOWN
    assert replace(one, why={reason: (), Reason.FORCES_LEFT: ()}).doubted is (reason in DOUBTS)
