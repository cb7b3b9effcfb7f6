"""Where markers sit on both feet is a habit of a laboratory, no shifted plate; bad evidence accuses no plate."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from inferred_sessions import heard
from walking import MASS, PLATES, Wrong, session, standing, walk

from biodance.diagnosis.diagnosis import Finding
from biodance.lab.markers.sets import GUESSED
from biodance.lab.session.read import read_session
from biodance.observations import observe, recording
from biodance.records import SIDES, Markers, Session, Trial


def named(found: Session) -> tuple[Finding, ...]:
    return heard(found).diagnosis.findings


def toes_moved(trial: Trial, inwards: float, *, edges: bool = False) -> Trial:
    """Return a walk whose toe markers were put ``inwards`` m (the feet point along x); with ``edges`` on both sides of
    the forefoot as well, where they belong.
    """
    markers = trial.markers
    assert markers is not None
    names, xyz, given = list(markers.names), np.array(markers.xyz), {}
    for side in SIDES:
        letter, inner = side[0].upper(), 1.0 if side == "right" else -1.0
        toe = xyz[:, names.index(f"{letter}TOE")]
        first, fifth = (toe + np.array([0.0, 0.05 * inner * way, 0.0]) for way in (1, -1))
        xyz[:, names.index(f"{letter}TOE")] += [0.0, inwards * inner, 0.0]
        if edges:
            names += [f"{letter}MT1", f"{letter}MT5"]
            xyz = np.concatenate([xyz, first[:, None], fifth[:, None]], axis=1)
            given |= {f"{letter}MT1": f"{side}_toe_medial", f"{letter}MT5": f"{side}_toe_lateral"}
        given |= {f"{letter}HEE": f"{side}_heel", f"{letter}TOE": f"{side}_toe"}
    given |= {"LASI": "left_asis", "RASI": "right_asis", "SACR": "mid_psis"}
    known = GUESSED + json.dumps(given) if edges else trial.marker_set
    return replace(trial, markers=Markers(tuple(names), markers.time, xyz), marker_set=known)


def test_toe_markers_on_the_first_ray_of_both_feet_accuse_no_plate() -> None:
    """Right foot on plate 1, left foot on plate 2, one direction: two plates shifted apart would look the same."""
    seen = session(standing(), *(toes_moved(walk(name=name), 0.04) for name in ("walk", "again")))
    (only,) = named(seen)
    assert (only.effect, only.target) == ("toe_landmark", "both")
    inwards = next(one for one in only.parameters if one.name == "inwards")
    assert inwards.interval[0] <= 0.04 <= inwards.interval[1]


def test_markers_on_both_edges_tell_where_the_foot_is() -> None:
    trials = [toes_moved(walk(name=name), 0.04, edges=True) for name in ("walk", "again")]
    assert named(session(standing(), *trials)) == ()
    values = {(one.observer, one.what): one.value for one in observe(recording(trials[0], mass=MASS), ["foot_across"])}
    assert len(values) == 6
    assert max(map(abs, values.values())) < 0.003


def test_a_plate_20_mm_off_is_named_or_stands_beside_the_landmark() -> None:
    wrong = Wrong(moved=(0.0, 0.02))
    for inwards in (0.0, 0.03):
        found = named(session(*(toes_moved(walk(wrong, name=name), inwards) for name in ("walk", "again"))))
        alike = {(alias.effect, alias.target) for one in found for alias in one.set}
        assert ("plate_position", "plate1:y") in alike
        assert {one.effect for one in found} <= {"plate_position", "toe_landmark"}


def test_a_pressure_half_a_metre_from_the_foot_tells_no_place() -> None:
    far = Wrong(moved=(0.0, 0.45))
    trials = []
    for name in ("walk", "again"):
        here, there = walk(name=name), walk(far, name=name)
        moved = [replace(a, wrench=b.wrench) for a, b in zip(here.plates, there.plates, strict=True)]
        trials.append(replace(here, plates=tuple(moved)))
    found = named(session(standing(), *trials))
    assert not [one for one in found if one.effect == "plate_position"]


def test_who_stands_half_beside_the_plates_weighs_nothing_there() -> None:
    whole = standing()
    assert whole.markers is not None
    names = [one.observer for one in observe(recording(whole, mass=MASS), ["standing_force", "standing_place"])]
    assert set(names) == {"standing_force", "standing_place"}
    aside = np.array(whole.markers.xyz)
    feet = [whole.markers.names.index(name) for name in ("LHEE", "LTOE")]
    aside[:, feet, 1] = PLATES["plate1"][1] + 0.24
    beside = replace(whole, markers=Markers(whole.markers.names, whole.markers.time, aside))
    assert observe(recording(beside, mass=MASS), ["standing_force", "standing_place"]) == ()


def test_who_stands_still_needs_no_moment_about_the_vertical() -> None:
    """The zero of Mz is seen by standing alone, to half a newton metre."""
    still, wrong = standing(), 9.0
    value = np.array(still.plates[0].wrench.value)
    value[:, 5] += wrong
    turned = replace(still, plates=(replace(still.plates[0], wrench=replace(still.plates[0].wrench, value=value)),))
    (right, off) = (observe(recording(one, mass=MASS), ["standing_twist"])[0] for one in (still, turned))
    assert abs(right.value) < 1e-9
    assert off.value == pytest.approx(wrong)
    (found,) = named(session(turned))
    assert (found.effect, found.target) == ("plate_offset", "Mz")
    assert found.parameters[0].interval[0] <= wrong <= found.parameters[0].interval[1]


def test_a_published_recording_whose_mz_is_off_is_told_so(data: Path) -> None:
    """The laboratory's own numbers: 10 to 12 N·m in every trial, standing too."""
    found = next(one for one in named(read_session(data / "laas_human/c3d")) if one.target == "Mz")
    assert found.effect == "plate_offset"
    assert 9.5 < abs(found.parameters[0].value) < 13.0


def test_a_stance_whose_beginning_was_not_recorded_has_no_phases() -> None:
    trial = walk()
    cut = tuple(
        replace(one, wrench=replace(one.wrench, time=one.wrench.time[1000:], value=one.wrench.value[1000:]))
        for one in trial.plates
    )
    seen = observe(recording(replace(trial, plates=cut), mass=MASS), ["foot_across", "shear"])
    assert {one.plate for one in seen} == {"plate2"}


def test_a_habit_of_the_laboratory_is_told_and_is_no_fault() -> None:
    seen = session(standing(), *(toes_moved(walk(name=name), 0.04) for name in ("walk", "again")))
    found = heard(seen).diagnosis
    assert [one.effect for one in found.findings] == ["toe_landmark"]
    assert found.faults == ()


@pytest.mark.parametrize(
    "name",
    [
        "c3d_parser_MH",
        "c3d_parser_FMC",
        "c3d_parser_Sydney",
        "opensim_models/gait10",
        "opensim_models/raj_walk",
        "opensim_models/raj_run",
    ],
)
def test_laboratories_without_a_fault_of_plates_accuse_none(name: str, data: Path) -> None:
    """One good step (MH), feet half beside (FMC), toe markers on the first ray and .mot files (OpenSim's examples)."""
    assert [one for one in named(read_session(data / name)) if one.effect.startswith("plate")] == []
