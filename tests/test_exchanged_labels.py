"""Exchanged labels: the right set from copies with the exchange in one file, in both, in none; two pairs at once;
mended copies.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from c3d_files import File, text
from lab_sessions import person

from biodance.effects import Recorded
from biodance.effects._base.wrists import back_of_hand, middle
from biodance.effects.labels_swapped import exchanges, renamed
from biodance.errors import FileRefused
from biodance.lab.c3d.raw import read_raw
from biodance.lab.c3d.results import write_relabelled
from biodance.lab.session.read import read_session
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


@pytest.mark.parametrize("pairs", [(("LKNE", "RKNE"),), (("LWRA", "LWRB"),), (("RWRA", "RWRB"),), HEAD])
@pytest.mark.parametrize("wrong", [(), ("static",), ("fit",), ("static", "fit")])
def test_every_copy_gives_the_right_set(pairs: tuple, wrong: tuple) -> None:
    found = found_in(*(swapped(one, pairs) if one.name in wrong else one for one in visit(speed=1.5)))
    assert found == dict.fromkeys(wrong, {tuple(sorted(pair)) for pair in pairs})


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
    copy = write_relabelled(source, tmp_path / "mended" / "walk.c3d", {"LASI": "RASI", "RASI": "LASI", "C7": "C7"})
    before, after = read_raw(source), read_raw(copy)
    assert after.labels == ("S:RASI", "S:LASI", "S:C7")
    np.testing.assert_array_equal(before.points, after.points)
    assert sum(a != b for a, b in zip(source.read_bytes(), copy.read_bytes(), strict=True)) == 2
    with pytest.raises(FileRefused, match="nothing is overwritten"):
        write_relabelled(source, copy, {})


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
    names = {one: other for pair in pairs for one, other in (pair, pair[::-1])}
    for number, path in enumerate(sorted((data / "biomechzoo/HC032A").glob("*.c3d"))):
        write_relabelled(path, tmp_path / path.name, names if number in wrong else {})
    session = read_session(tmp_path)
    right = {session.trials[number].name: set(pairs) for number in wrong}
    assert found_in(*session.trials) == right
