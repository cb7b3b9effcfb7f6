"""Exchanged labels: the right set from copies with the exchange in one file, in both, in none; two pairs at once;
mended copies.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from c3d_files import File, text
from human_cases import human_case
from lab_sessions import person

from biodance.effects import Recorded
from biodance.effects._base.body_sides import back_of_hand, crossed_sides, middle, rightwards
from biodance.effects._base.exchanged_labels import set_of
from biodance.effects._base.rigid_groups import RigidGroup
from biodance.effects.labels_swapped import LabelsSwapped, exchanges, refuted, renamed
from biodance.errors import FileRefused
from biodance.lab.c3d.raw import read_raw
from biodance.lab.c3d.results import write_exchanged
from biodance.lab.session.read import read_session
from biodance.pipeline.accepted import with_right_labels, write_mended
from biodance.pipeline.judged_trials import recorded_of
from biodance.pipeline.results import SessionResult
from biodance.records import Markers, Session, Source, Subject, Trial

HEAD = (("LFHD", "RFHD"), ("LBHD", "RBHD"))
WRISTS = {side: (f"{side}WRA", f"{side}WRB") for side in "LR"}


def swapped(trial: Trial, pairs: tuple, start: int = 0, stop: int | None = None) -> Trial:
    """Return the trial with the two markers of each pair exchanged from frame ``start`` to ``stop``."""
    columns = list(trial.markers.names)
    xyz = trial.markers.xyz.copy()
    for a, b in pairs:
        i, j = columns.index(a), columns.index(b)
        xyz[start:stop, [i, j]] = trial.markers.xyz[start:stop, [j, i]]
    return replace(trial, markers=Markers(trial.markers.names, trial.markers.time, xyz))


def found_in(*trials: Trial) -> dict[str, set]:
    """Return the pairs that are found by trial."""
    session = Session(Subject(62.0, 1.7, "F"), trials, Path())
    return {name: set(pairs) for name, pairs in exchanges(Recorded(session)).items()}


def visit(*, speed: float) -> tuple[Trial, Trial]:
    """Return a static and a walk at ``speed`` m/s; the head band sits a centimetre askew, as all do."""
    trials = []
    for role, moving in (("static", 0.0), ("fit", speed)):
        markers = person(frames=120, speed=moving)
        xyz = markers.xyz.copy()
        xyz[:, markers.names.index("RBHD")] += [-0.02, 0.012, 0.0]
        source = Source(Path(f"{role}.c3d"), "", "C3D", 100.0)
        trials.append(Trial(role, role, Markers(markers.names, markers.time, xyz), (), source, "plug_in_gait"))
    return trials[0], trials[1]


@pytest.mark.parametrize("count", [2, 4])
def test_distances_alone_say_how_well_a_shape_can_fit_at_best(count: int) -> None:
    rng = np.random.default_rng(count)
    shape, xyz = rng.normal(size=(count, 3)), rng.normal(size=(50, count, 3))
    group = RigidGroup(tuple("abcd"[:count]), shape - shape.mean(axis=0))
    markers = Markers(group.labels, np.arange(50) / 100, xyz)
    misfit = group.misfit(markers, {}, np.arange(50))
    least = group.least_misfit(np.linalg.norm(xyz[:, :, None] - xyz[:, None], axis=3), list(range(count)))
    assert (least <= misfit + 1e-12).all()
    if count == 2:  # each takes half of the way
        np.testing.assert_allclose(least, misfit, atol=1e-12)


@pytest.mark.parametrize("pairs", [(("LKNE", "RKNE"),), (("LWRA", "LWRB"),), (("RWRA", "RWRB"),), HEAD])
@pytest.mark.parametrize("wrong", [(), ("static",), ("fit",), ("static", "fit")])
def test_every_copy_gives_the_right_set(pairs: tuple, wrong: tuple) -> None:
    found = found_in(*(swapped(one, pairs) if one.name in wrong else one for one in visit(speed=1.5)))
    assert found == {name: {tuple(sorted(pair)) for pair in pairs} for name in wrong}


def test_markers_flung_about_say_nothing_of_names() -> None:
    static, walk = visit(speed=1.5)
    walk = swapped(walk, HEAD)
    flung = walk.markers.xyz.copy()
    flung[::5] *= 30.0
    for xyz, told in ((walk.markers.xyz, {"fit"}), (flung, set())):
        trial = replace(walk, markers=Markers(walk.markers.names, walk.markers.time, xyz))
        assert set(found_in(static, trial)) == told


def test_an_object_in_the_room_hides_no_exchange() -> None:
    static, walk = visit(speed=1.5)
    walk = swapped(walk, HEAD)
    names, xyz = (*walk.markers.names, "corner"), walk.markers.xyz
    far = np.full((len(xyz), 1, 3), 6.0)
    trial = replace(walk, markers=Markers(names, walk.markers.time, np.concatenate([xyz, far], axis=1)))
    assert set(found_in(static, trial)) == {"fit"}


def bent(trial: Trial, degrees: float) -> Trial:
    """Return the trial with the left finger's marker turned about the wrist, to the back of the hand or (below zero)
    to the palm.
    """
    markers, angle = trial.markers, -np.radians(degrees)
    along = markers["LFIN"] - (markers["LWRA"] + markers["LWRB"]) / 2
    across = np.cross(along, markers["LWRA"] - markers["LWRB"])
    across *= np.linalg.norm(along, axis=1, keepdims=True) / np.linalg.norm(across, axis=1, keepdims=True)
    xyz = markers.xyz.copy()
    xyz[:, markers.names.index("LFIN")] += (np.cos(angle) - 1) * along + np.sin(angle) * across
    return replace(trial, markers=Markers(markers.names, markers.time, xyz))


@pytest.mark.parametrize("wrong", [False, True])
def test_a_wrist_exchanged_where_the_arms_do_anything_mirrors_the_static_trial(wrong: bool) -> None:
    static, dance = (bent(one, 30.0) for one in visit(speed=0.0))
    assert middle(back_of_hand(static.markers, "L")) > 0.4
    dance = swapped(dance, (WRISTS["L"],)) if wrong else dance
    assert found_in(static, dance) == ({"fit": {WRISTS["L"]}} if wrong else {})


def test_a_hand_that_is_bent_to_the_palm_is_no_mirror_image() -> None:
    static, dance = visit(speed=0.0)
    static, dance = bent(static, 30.0), bent(dance, -70.0)
    assert middle(back_of_hand(dance.markers, "L")) < -0.8
    assert found_in(static, dance) == {}


def test_a_head_that_looks_back_has_its_names() -> None:
    """Left of it lies on the right of the body, but under other names the band would not be as in the static trial."""
    static, walk = visit(speed=1.5)
    columns = [walk.markers.names.index(name) for pair in HEAD for name in pair]
    xyz = walk.markers.xyz.copy()
    middle_of_head = xyz[:, columns].mean(axis=1, keepdims=True)
    xyz[:, columns] = middle_of_head + (xyz[:, columns] - middle_of_head) * [-1.0, -1.0, 1.0]
    back = replace(walk, markers=Markers(walk.markers.names, walk.markers.time, xyz))
    assert set(crossed_sides(back.markers, rightwards(back.markers, set_of(back)))) == set(HEAD)
    assert found_in(static, back) == {}


def test_a_trial_that_is_mended_has_nothing_exchanged() -> None:
    static, walk = visit(speed=1.5)
    wrong = swapped(walk, HEAD)
    session = Session(Subject(62.0, 1.7, "F"), (static, wrong), Path())
    mended = renamed(wrong, exchanges(Recorded(session))["fit"])
    np.testing.assert_array_equal(mended.markers["LFHD"], walk.markers["LFHD"])
    assert found_in(static, mended) == {}
    assert "were exchanged" in mended.history[-1]


def test_a_copy_with_other_labels_is_the_same_to_the_byte_elsewhere(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    points = np.concatenate([rng.normal(0, 500, (20, 3, 3)), np.zeros((20, 3, 1))], axis=2)
    source = tmp_path / "walk.c3d"
    source.write_bytes(File(points, parameters={"POINT": {"LABELS": text("S:LASI", "S:RASI", "S:C7")}}).bytes())
    copy = write_exchanged(source, tmp_path / "mended" / "walk.c3d", {("LASI", "RASI"): [(0, 20)]})
    before, after = read_raw(source), read_raw(copy)
    assert after.labels == ("S:RASI", "S:LASI", "S:C7")
    np.testing.assert_array_equal(before.points, after.points)
    assert sum(a != b for a, b in zip(source.read_bytes(), copy.read_bytes(), strict=True)) == 2
    with pytest.raises(FileRefused, match="is not overwritten"):
        write_exchanged(source, copy, {})


@pytest.mark.parametrize(
    ("child", "truth"),
    [
        ("HC030A", {name: {("LWRA", "LWRB")} for name in ("HC030A01", "HC030A05", "HC030A22")}),
        ("HC055A", {"HC055A34": {("LFHD", "RFHD"), ("LBHD", "RBHD")}}),
        ("HC038A", {"HC038A11": {("LWRA", "LWRB"), ("RWRA", "RWRB")}}),
        ("HC050A", {"HC050A11": {("LWRA", "LWRB")}}),
        ("HC002D", {}),
        ("HC031A", {}),
        ("HC032A", {}),
        ("HC036A", {}),
        ("HC044A", {}),
    ],
)
def test_real_exchanges_are_found_and_no_others(child: str, truth: dict, data: Path) -> None:
    assert found_in(*read_session(data / "biomechzoo" / child).trials) == truth


FRONT = (("LBHD", "LFHD"), ("RBHD", "RFHD"))


@pytest.mark.parametrize(
    ("wrong", "pairs"),
    [
        ((), ()),
        ((1,), (WRISTS["R"],)),
        ((0, 1, 2), tuple(WRISTS.values())),
        ((0, 1, 2), FRONT),
    ],
)
def test_real_copies_with_exchanged_bytes_give_the_right_set(
    wrong: tuple, pairs: tuple, data: Path, tmp_path: Path
) -> None:
    for number, path in enumerate(sorted((data / "biomechzoo/HC032A").glob("*.c3d"))):
        whole = [(0, len(read_raw(path).points))]
        write_exchanged(path, tmp_path / path.name, dict.fromkeys(pairs, whole) if number in wrong else {})
    session = read_session(tmp_path)
    right = {session.trials[number].name: set(pairs) for number in wrong}
    assert found_in(*session.trials) == right


def test_real_toe_labels_exchanged_in_both_runs_are_found(data: Path) -> None:
    """Toe to heel 209 and 173 mm in the static trial, 171 and 209 mm in the runs."""
    pair = {("R.MT1", "R.MT5")}
    assert found_in(*read_session(data / "rbds/S001").trials) == {"runT25": pair, "runT35": pair}


def test_a_real_wrist_exchanged_from_the_middle_of_a_trial_on_is_found_to_the_frame(data: Path) -> None:
    """From 17.63 s on the right wrist's markers lie where the other one lay a frame before (60 mm in 33 ms), and are
    260 and 274 mm from the elbow, 273 and 259 mm until then.
    """
    session = read_session(data / "laas_human/c3d")
    assert {name: dict(pairs) for name, pairs in exchanges(Recorded(session)).items()} == {
        "march": {("RWRA", "RWRB"): ((529, 978),)}
    }
    assert "march from 17.63 to 32.57 s" in LabelsSwapped.check(Recorded(session))[0].text


PARTS = [
    (("LKNE", "RKNE"),),
    (("LASI", "RASI"),),
    (("LWRA", "LWRB"),),
    (("LFIN", "RFIN"),),
    (("LFIN", "RFIN"), ("LWRA", "RWRA"), ("LWRB", "RWRB")),
    (("HEE", "TOE"),),
    HEAD,
]


@pytest.mark.parametrize("pairs", PARTS)
def test_an_exchange_for_half_a_second_is_found_to_the_frame_and_put_right(pairs: tuple, data: Path) -> None:
    pairs = tuple((f"L{a}", f"L{b}") if len(a) == 3 else (a, b) for a, b in pairs)
    static, walk = (trial for trial in read_session(data / "biomechzoo/HC032A").trials[:2])
    wrong = swapped(walk, pairs, 70, 120)
    found = exchanges(Recorded(Session(Subject(60.3, 1.7, "F"), (static, wrong), Path())))
    assert found == {walk.name: {tuple(sorted(pair)): ((70, 120),) for pair in pairs}}
    mended = renamed(wrong, found[walk.name])
    for label in (label for pair in pairs for label in pair):
        np.testing.assert_array_equal(mended.markers[label], walk.markers[label])
    assert "from 0.70 to 1.19 s" in mended.history[-1]


def test_an_exchange_of_some_frames_is_put_right_in_a_copy_and_nothing_else(data: Path, tmp_path: Path) -> None:
    source = data / "biomechzoo/HC032A/HC032A03.c3d"
    wrong = write_exchanged(source, tmp_path / "wrong.c3d", {("LKNE", "RKNE"): [(70, 120)]})
    before, after = read_raw(source), read_raw(wrong)
    left, right = (before.labels.index(label) for label in ("LKNE", "RKNE"))
    np.testing.assert_array_equal(after.points[70:120, left], before.points[70:120, right])
    np.testing.assert_array_equal(after.points[:70, left], before.points[:70, left])
    again = write_exchanged(wrong, tmp_path / "right.c3d", {("LKNE", "RKNE"): [(70, 120)]})
    assert again.read_bytes() == source.read_bytes()


def test_a_label_that_no_point_has_is_refused_and_nothing_is_written(data: Path, tmp_path: Path) -> None:
    copy = tmp_path / "none.c3d"
    with pytest.raises(FileRefused, match="holds no point LXXX"):
        write_exchanged(data / "biomechzoo/HC032A/HC032A03.c3d", copy, {("LXXX", "RKNE"): [(0, 5)]})
    assert not copy.exists()


@pytest.mark.parametrize("child", ["HC002D", "HC036A"])
def test_swinging_arms_are_no_exchanged_hands_and_accepting_writes_no_label(
    child: str, recording: Callable[[str], SessionResult]
) -> None:
    result = recording(f"biomechzoo/{child}")
    assert with_right_labels(result, recorded_of(result), tell=lambda text: None) is None


def test_accepting_writes_what_it_says_and_nothing_else(
    recording: Callable[[str], SessionResult], tmp_path: Path
) -> None:
    result = recording("biomechzoo/HC055A")
    session = result.session
    copy, right = with_right_labels(result, recorded_of(result), tell=lambda text: None)
    assert {name: set(pairs) for name, pairs in right.exchanged.items()} == {"HC055A34": set(map(sorted_pair, HEAD))}
    written, refused = write_mended(session, right, tmp_path)
    assert [one.file for one in written] == ["mended/HC055A34.c3d"]
    assert written[0].what == "names exchanged: LFHD and RFHD, LBHD and RBHD"
    assert refused == ()
    assert [path.name for path in tmp_path.rglob("*.c3d")] == ["HC055A34.c3d"]
    before, after = (next(t for t in one.trials if t.name == "HC055A34").fit for one in (result, copy))
    assert after.total_rms < 0.4 * before.total_rms


def sorted_pair(pair: tuple[str, str]) -> tuple[str, str]:
    return (min(pair), max(pair))


def test_names_that_a_body_follows_worse_are_refused() -> None:
    case = human_case(120)
    trial = case.trial
    whole = ((0, trial.markers.time.size),)
    assert refuted(case.body, trial, {("LWRA", "RWRA"): whole})
    assert not refuted(case.body, swapped(trial, (("LWRA", "RWRA"),)), {("LWRA", "RWRA"): whole})


@pytest.mark.parametrize("with_static", [True, False])
def test_a_body_placed_by_the_labels_in_question_refutes_nothing(
    with_static: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A walk without a static trial gives the body by its own labels: it follows them, whatever they are."""
    monkeypatch.setattr("biodance.effects.labels_swapped.refuted", lambda *_: True)
    static, walk = visit(speed=1.5)
    wrong = swapped(walk, (("LASI", "RASI"),))
    session = Session(Subject(62.0, 1.7, "F"), (static, wrong) if with_static else (wrong,), Path())
    case: Any = SimpleNamespace(trial=wrong, body=None)
    found = exchanges(Recorded(session, (case,)))
    assert {name: set(pairs) for name, pairs in found.items()} == ({} if with_static else {"fit": {("LASI", "RASI")}})
