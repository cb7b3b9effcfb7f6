"""Every cause hidden in sessions of three people, written as C3D files, and found again by the command: named first,
in a set of few, with its sign and its size, and with a gain on a trial that was kept; or, for those of `UNTOLD`, at
least no other one.

The suite runs the causes of `ALWAYS` in one of them; ``make hidden``, as CI, every cause in two of them (the first and
one of the others in turn), ``make hidden PART=all`` in all three, ``PART=2/7`` a seventh.
"""

import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hidden_faults import SUBJECT, TRIALS, hidden
from shared_markers import markers_asked_once

from biodance.cli import run
from biodance.records import Subject
from biodance.virtual_lab.causes import Hidden, parse_cause

PEOPLE = {
    "woman": (SUBJECT, 41),
    "man": (Subject(82.0, 1.84, "M", 45.0), 43),
    "small woman": (Subject(55.0, 1.60, "F", 60.0), 47),
}
"""Who is recorded, and the seed of the recording."""

ALWAYS = (
    "plate_rotation:target=plate1:z,angle=-0.08",
    "added_mass:target=right_forearm_hand,mass=2.4",
    "external_contact:target=right_forearm_hand,force=15",
)
CAUSES = (
    *ALWAYS,
    "plate_position:target=plate1:x,shift=0.05",
    "plate_position:target=plate1:y,shift=-0.05",
    "plate_gain:target=Fz,gain=-0.06",
    "plate_offset:target=Fz,offset=25",
    "plate_offset:target=Fx,offset=-12",
    "plate_offset:target=My,offset=10",
    "plate_drift:target=Mx,drift=-15",
    "plate_crosstalk:target=Fz->Fx,ratio=-0.025",
    "plate_crosstalk:target=Fz->My,ratio=0.03",
    "plate_hysteresis:target=Fz,width=4",
    "body_mass:error=6",
    "lab_tilt:target=x,angle=-0.05",
    "time_delay:delay=-0.02",
    "clock_drift:stretch=0.03",
    "filter_mismatch:cutoff=3",
    "body_weight_support:target=pelvis,force=25,stiffness=25",
    "sloshing_load:target=trunk_head,mass=6,sloshing=4.5",
    "wobbling_mass:target=trunk_head,mass=8",
    "added_mass:target=right_shank,mass=4",
    "added_mass:target=trunk_head,mass=7",
    "unequal_limbs:target=left_shank,lighter=2",
    "head_joint:angle=0.25",
    "trunk_joint:angle=0.2",
    "shoulder_girdle:angle=0.25",
    "joint_centre:target=right_shoulder,shift=0;0;0.07",
    "marker_misplaced:target=RKNE,shift=0.06;0;0",
    "marker_misplaced:target=LSHO,shift=0.06;0;0",
)
UNTOLD = (
    "head_joint:angle=0.25",  # the body has a neck where its markers show one, so that no joint is missing
    "joint_centre:target=right_shoulder,shift=0;0;0.07",
)
"""What half a minute of this movement does not tell (a body explains most of it): these must not name another cause.
Whoever makes one of them nameable takes it out of here.
"""
KEPT = "squat_1"
"""Trial that no fit sees; where the plates do not measure it whole, each of the others is kept in turn."""
UNGAINED = ("marker_misplaced", "external_contact")
"""What is put right in the body before anything is fitted (no model without it is left to compare with), and a touch,
which has another course in every trial.
"""
SET = 3
"""Causes that may stand in the set of one finding."""
WITHIN = 0.25
"""Error of a size, beside two of its standard deviations."""


def asked() -> list[tuple[str, str]]:
    """Return person and cause of the part that BIODANCE_HIDDEN names (``2/7``; ``all``), or those always run."""
    word = os.environ.get("BIODANCE_HIDDEN", "")
    first, *others = PEOPLE
    every = [(who, text) for who in PEOPLE for text in CAUSES]
    if word in ("", "all"):
        return every if word else every[: len(ALWAYS)]
    part, _, parts = word.partition("/")
    twice = [(first, text) for text in CAUSES]
    twice += [(others[k % len(others)], text) for k, text in enumerate(CAUSES)]
    return twice[int(part) - 1 :: int(parts)]


def sizes(one: dict[str, Any], name: str) -> tuple[np.ndarray, np.ndarray]:
    """Return the values (n,) of a parameter and their standard deviations."""
    axes = [p for key, p in one["parameters"].items() if key.startswith(f"{name}_")] or [one["parameters"][name]]
    return np.array([p["value"] for p in axes]), np.array([p["sd"] for p in axes])


def assert_named(document: dict[str, Any], hidden: Hidden) -> None:
    """Require the cause as the first finding, in a small set, with its sign, its size and its gain."""
    assert document["verdict"].startswith("named"), document["notes"]
    first = document["findings"][0]
    assert (first["effect"], first["target"]) == (hidden.name, hidden.target)
    assert len(first["set"]) <= SET, first["set"]
    name, true = next(iter(hidden.values.items()))
    value, sd = sizes(first, name)
    if value.size > len(true):  # mostly from below, in a direction that is drawn
        true = np.linalg.norm(true) * value / np.linalg.norm(value) * np.sign(value[-1])
    along = float(value @ true / np.linalg.norm(true))
    assert along > 0, "the wrong sign"
    assert along == pytest.approx(np.linalg.norm(true), rel=WITHIN, abs=2 * float(sd.max()))
    if hidden.name not in UNGAINED:
        assert first["gain"]["trials"], "no gain was measured"
        assert first["gain"]["ci95"][0] > 0, "no gain on trials that were kept"


@pytest.fixture(autouse=True)
def _what_only_markers_tell_is_found_once() -> Iterator[None]:
    """Let sessions of a person in which only forces are wrong share what their markers tell."""
    with markers_asked_once():
        yield


@pytest.mark.parametrize(("who", "text"), asked())
def test_a_hidden_cause_is_named_in_a_small_set_with_sign_size_and_gain(
    who: str, text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    person, seed = PEOPLE[who]
    folder = hidden(tmp_path / "s", text, seed=seed, trials=(*TRIALS, KEPT), person=person)
    code = run(["diagnose", str(folder), "--accept", "--out", str(tmp_path / "out"), "--json"])
    document = json.loads(capsys.readouterr().out)
    if text in UNTOLD:
        assert document["verdict"] in ("unexplained", "nothing wrong")
        assert not document["findings"]
    else:
        assert code == 1
        assert_named(document, parse_cause(text))
