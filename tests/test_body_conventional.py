"""The conventional gait model on two rigid legs, built here, whose angles are known; Vicon's own stand in
test_real_sessions.
"""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from biodance.body.human.conventional import ConventionalModel, conventional_model
from biodance.body.human.measures import davis_hip
from biodance.errors import TrialRefused
from biodance.records import Array, Markers, Role, Source, Subject, Trial

SIZES = {"MarkerDiameter": 0.014, "LLegLength": 0.86, "RLegLength": 0.86, "InterAsisDistance": 0.24}
SIZES |= {f"{side}{joint}Width": width for side in "LR" for joint, width in (("Knee", 0.1), ("Ankle", 0.07))}
LEAN = float(np.degrees(np.arctan2(0.03, 0.16)))  # deg by which the pelvis tilts forwards
THIGH = SHANK = np.array([0.0, 0.0, 0.4])
X = np.array([1.0, 0.0])


def turned(axis: str, degrees: float, points: Array) -> Array:
    return Rotation.from_euler(axis, degrees, degrees=True).apply(points)


def pose(
    hip: float = LEAN, knee: float = 0.0, ankle: float = 0.0, *, wand: float = 0.0, torsion: float = 0.0
) -> dict[str, Array]:
    """Label -> (3,) m of a person who faces x; hips and knees flexed, toes up by so many degrees; the thighs' wands sit
    ``wand`` degrees in front of the knees' axes, the ankles' axes point ``torsion`` degrees backwards.
    """
    mark = {"RASI": [0.0, -0.12, 0.0], "LASI": [0.0, 0.12, 0.0], "SACR": [-0.16, 0.0, 0.03]}
    forward, up, across = davis_hip(0.24, 0.86, 0.1288 * 0.86 - 0.04856, 0.007)
    for side, out in (("R", -1.0), ("L", 1.0)):
        outwards = np.array([0.0, out, 0.0])
        at = turned("y", LEAN, np.array([forward, out * across, up]))
        malleolus = turned("z", out * torsion, outwards)
        foot = turned("y", -ankle, np.array([[0.15, 0.0, -0.05], [-0.05, 0.0, -0.05]]))
        below = np.stack([0.08 * malleolus + SHANK / 2, 0.042 * malleolus, -0.042 * malleolus, *foot]) - SHANK
        above = np.stack([0.057 * outwards, -0.057 * outwards, turned("z", -out * wand, 0.1 * outwards) + THIGH / 2])
        leg = at + turned("y", LEAN - hip, np.concatenate([above, turned("y", knee, below)]) - THIGH)
        names = ("KNE", "KNM", "THI", "TIB", "ANK", "MED", "TOE", "HEE")
        mark |= {f"{side}{name}": place for name, place in zip(names, leg, strict=True)}
    return {name: np.asarray(place) for name, place in mark.items()}


def trial(role: Role, mark: dict[str, Array], *, without: tuple[str, ...] = ()) -> Trial:
    names = tuple(name for name in mark if name not in without)
    places = np.stack([mark[name] for name in names])
    xyz = np.tile(places + np.array([0.0, 0.0, 0.9]), (60, 1, 1))
    markers = Markers(names, np.arange(60) / 100, xyz)
    return Trial(
        role,
        role,
        markers,
        (),
        Source(Path("made.c3d"), "", "test", 100.0),
        marker_set="plug_in_gait",
        measurements=SIZES,
    )


def model(*, without: tuple[str, ...] = (), **standing: float) -> ConventionalModel:
    return conventional_model(Subject(60.0, 1.7, "F"), trial("static", pose(**standing), without=without))


MEDIAL = ("RKNM", "LKNM", "RMED", "LMED")


@pytest.mark.parametrize(
    ("without", "axes"), [(MEDIAL, {}), ((), {"wand": 25.0, "torsion": 20.0})], ids=["wands", "medial markers"]
)
def test_flexion_of_hip_knee_and_ankle_are_those_of_the_legs(without: tuple[str, ...], axes: dict[str, float]) -> None:
    person = model(without=without, **axes)
    walked = person.of(trial("fit", pose(30.0, 50.0, 10.0, **axes), without=MEDIAL))
    assert walked is not None
    for side in ("right", "left"):
        found = {name: float(value[0]) for name, value in walked.angles(side, X).items()}
        assert found["hip_flexion"] == pytest.approx(30.0, abs=1e-6)
        assert found["knee_flexion"] == pytest.approx(50.0, abs=1e-6)
        assert found["pelvis_tilt"] == pytest.approx(LEAN, abs=1e-6)
        # The ankle bends about its own axis, which is the knee's turned outwards.
        assert found["ankle_dorsiflexion"] == pytest.approx(10.0, abs=0.7 if axes else 1e-6)
        for name in ("hip_adduction", "hip_rotation", "pelvis_obliquity", "pelvis_rotation"):
            assert found[name] == pytest.approx(0.0, abs=1e-6), name


def test_a_wand_beside_the_axis_turns_the_hip_and_the_knee_where_nothing_else_shows_the_axis() -> None:
    person = model(without=MEDIAL, wand=25.0)
    walked = person.of(trial("fit", pose(30.0, 50.0, wand=25.0), without=MEDIAL))
    assert walked is not None
    right, left = (walked.angles(side, X) for side in ("right", "left"))
    assert right["hip_rotation"][0] == pytest.approx(left["hip_rotation"][0], abs=1e-6)  # inwards on both sides
    assert 15.0 < right["hip_rotation"][0] < 35.0
    assert right["knee_flexion"][0] < 49.0


def test_a_trunk_that_turns_is_told_against_the_axis_of_the_laboratory_and_own_side_forwards() -> None:
    person = model(without=MEDIAL)
    mark = {name: turned("z", 8.0, place[None])[0] for name, place in pose().items()}  # to the left: right side ahead
    walked = person.of(trial("fit", mark, without=MEDIAL))
    assert walked is not None
    for side, sign in (("right", 1.0), ("left", -1.0)):
        found = walked.angles(side, X)
        # Tilt first: what is left of the turn shrinks with it (Baker 2001).
        turn = np.degrees(np.arctan(np.tan(np.radians(8.0)) * np.cos(np.radians(LEAN))))
        assert found["pelvis_rotation"][0] == pytest.approx(sign * turn, abs=1e-6)
        assert found["foot_progression"][0] == pytest.approx(sign * 8.0, abs=1e-6)


def test_without_a_wand_there_is_no_model_and_a_walk_without_one_has_no_marks() -> None:
    with pytest.raises(TrialRefused, match="needs right_thigh_wand, left_thigh_wand"):
        model(without=("RTHI", "LTHI"))
    assert model(without=MEDIAL).of(trial("fit", pose(), without=("LTIB",))) is None
