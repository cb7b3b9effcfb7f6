"""A C3D file as a trial: units, axes, labels, subjects, measures; every decision said."""

import numpy as np
import pytest
from c3d_files import File, real, text, whole

from biodance.errors import FileRefused
from biodance.lab.c3d.raw import model_outputs
from biodance.lab.inspect import inspect_file
from biodance.lab.markers.upright import extents, likely_unit
from biodance.lab.readers.c3d import read_c3d


def _sided(*places):
    return tuple(f"{side}{place}" for place in places for side in "LR")


LABELS = (*_sided("ASI", "PSI", "HEE", "TOE"), "C7", "CLAV", "T10", "STRN", *_sided("KNE", "ANK"))
LABELS += (*_sided("THI", "TIB", "SHO", "ELB"), "LWRA", "RWRA", "LWRB", "RWRB", *_sided("FHD", "BHD"))
HEIGHTS = dict.fromkeys(LABELS, 1.0) | dict.fromkeys(("LFHD", "RFHD", "LBHD", "RBHD"), 1.65)
HEIGHTS |= dict.fromkeys(("LHEE", "RHEE", "LTOE", "RTOE"), 0.05) | dict.fromkeys(("C7", "LSHO", "RSHO"), 1.45)
FRAMES = 4
PLATE = np.array([[0.4, 0.6, 0.0], [0.0, 0.6, 0.0], [0.0, 0.0, 0.0], [0.4, 0.0, 0.0]])
Z_UP = np.eye(3)
Y_UP = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])  # file_R_lab: z of the lab is y of the file
AWAY = np.array([1.0, 0.0, 0.0])
X_UP = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])
Z_DOWN = np.diag([1.0, -1.0, -1.0])


def person():
    """(T, K, 3) m, z up: somebody who stands near the lab origin."""
    generator = np.random.default_rng(5)
    xyz = np.stack(
        [
            generator.uniform(-0.2, 0.2, len(LABELS)),
            generator.uniform(0, 0.5, len(LABELS)),
            [HEIGHTS[n] for n in LABELS],
        ],
        axis=1,
    )
    return np.repeat(xyz[None], FRAMES, axis=0) + 0.001 * np.arange(FRAMES)[:, None, None]


def file(points=None, labels=LABELS, *, turn=Z_UP, unit="mm", per_metre=1000.0, plates=False, screen=None, more=None):
    """Return a file of a person whose lab axes are turned by file_R_lab and whose lengths count ``per_metre``."""
    xyz = (person() if points is None else points) @ turn.T * per_metre
    groups = {"POINT": {"LABELS": text(*labels), "UNITS": text(unit) if unit is not None else None}}
    if screen:
        groups["POINT"] |= {"X_SCREEN": text(screen[0]), "Y_SCREEN": text(screen[1])}
    analog = np.empty((0, 0))
    if plates:
        analog = np.zeros((10 * FRAMES, 6))
        groups["FORCE_PLATFORM"] = {
            "USED": whole(1),
            "TYPE": whole(2),
            "ZERO": whole(1, 0),
            "CORNERS": real(*(PLATE @ turn.T * per_metre).ravel(), shape=(3, 4, 1)),
            "ORIGIN": real(0, 0, -0.04 * per_metre, shape=(3, 1)),
            "CHANNEL": whole(*range(1, 7), shape=(6, 1)),
        }
        groups["ANALOG"] = {"UNITS": text("N", "N", "N", "Nmm", "Nmm", "Nmm")}
    for group, values in (more or {}).items():
        groups[group] = groups.get(group, {}) | values
    points = np.concatenate([xyz, np.zeros((*xyz.shape[:2], 1))], axis=2)
    return File(points, analog, parameters=groups)


@pytest.fixture
def read(tmp_path):
    def save_and_read(recording, **options):
        path = tmp_path / "trial.c3d"
        path.write_bytes(recording.bytes())
        return read_c3d(path, **options)

    return save_and_read


@pytest.mark.parametrize(("unit", "per_metre"), [("mm", 1000), ("cm", 100), ("m", 1), ("Meters", 1), ("MM", 1000)])
def test_declared_units(read, unit, per_metre):
    trial = read(file(unit=unit, per_metre=per_metre))
    np.testing.assert_allclose(trial.markers.xyz, person(), atol=1e-6)
    assert trial.warnings == ()
    assert any("POINT:UNITS" in line for line in trial.history)


@pytest.mark.parametrize(
    ("unit", "per_metre"), [(None, 1000), ("", 1), ("furlong", 100), ("m", 1000), ("mm", 1), ("cm", 1000)]
)
def test_missing_odd_or_impossible_units_are_decided_by_the_size_of_the_person_and_said(read, unit, per_metre):
    trial = read(file(unit=unit, per_metre=per_metre))
    np.testing.assert_allclose(trial.markers.xyz, person(), atol=1e-6)
    assert "can only be in" in trial.warnings[0]


def test_a_cloud_is_measured_where_it_is_seen_and_tells_its_unit():
    cloud = np.array([[[0.0, 0, 0], [3, 4, 5], [9, np.nan, 9]], [[0, 0, 0], [np.nan] * 3, [np.nan] * 3]])
    assert extents(cloud, 2).tolist() == [[9.0, 4.0, 9.0]]
    assert extents(cloud, 1).tolist() == [[9.0, 4.0, 9.0], [0.0, 0.0, 0.0]]
    assert extents(cloud, 3).shape == (0, 3)
    assert [likely_unit(size) for size in (1800.0, 180.0, 0.9)] == ["mm", "cm", "m"]
    assert likely_unit(0.6, 0.6) == "m"


def test_a_unit_that_nothing_tells_is_refused(read):
    with pytest.raises(FileRefused, match="tell the unit of length"):
        read(file(person()[:, :2], LABELS[:2], unit=None))


@pytest.mark.parametrize("plates", [False, True])
@pytest.mark.parametrize("turn", [Z_UP, Y_UP, X_UP, Z_DOWN])
@pytest.mark.parametrize("screen", [None, ("+X", "+Y")])
def test_z_points_up_whatever_the_lab_has(read, turn, plates, screen):
    trial = read(file(turn=turn, plates=plates, screen=screen))
    xyz = trial.markers.xyz
    np.testing.assert_allclose(xyz[..., 2], person()[..., 2], atol=1e-6)
    step = xyz[:, 1:] - xyz[:, :-1]
    true = person()[:, 1:] - person()[:, :-1]
    volume, true_volume = np.linalg.det(step[0, :3]), np.linalg.det(true[0, :3])
    np.testing.assert_allclose(volume, true_volume, atol=1e-9)  # turned, never mirrored
    if not np.array_equal(turn, np.eye(3)):
        assert any("turned so that z points up" in line for line in trial.history)
    if plates:
        np.testing.assert_allclose(trial.plates[0].corners[:, 2], 0.0, atol=1e-9)


def test_y_up_becomes_z_with_x_kept(read):
    np.testing.assert_allclose(read(file(turn=Y_UP)).markers.xyz, person(), atol=1e-6)


def test_a_person_who_lies_down_does_not_turn_the_lab(read):
    lying = person() @ np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]]).T + [0.0, 0.0, 0.3]
    for options in ({"screen": ("+X", "+Z")}, {"plates": True}):
        trial = read(file(lying, **options))
        np.testing.assert_allclose(trial.markers.xyz, lying, atol=1e-6)
        assert any("by the markers from feet to head" in line for line in trial.warnings)


def test_the_screen_decides_for_a_few_unknown_markers(read):
    few = person()[:, :5]
    trial = read(file(few, ("A1", "A2", "A3", "A4", "A5"), turn=Y_UP, screen=("+X", "+Y")))
    np.testing.assert_allclose(trial.markers.xyz, few, atol=1e-6)
    trial = read(file(few, ("A1", "A2", "A3", "A4", "A5")))
    assert "Nothing says which way is up" in trial.warnings[0]


def test_model_outputs_and_unlabelled_points_are_no_markers(read):
    points = np.concatenate([person(), 500 * np.ones((FRAMES, 9, 3))], axis=1)
    labels = (*LABELS, "LKneeAngles", "MyOwnOutput", "Listed", "PELO", "PELA", "PELL", "PELP", "*17", "")
    types = {"TYPE_GROUPS": text("STRANGE", "STRANGER"), "STRANGE": text("MyOwnOutput"), "ANGLES": text("Listed")}
    trial = read(file(points, labels, more={"POINT": types}))
    assert trial.markers.names == LABELS
    assert trial.marker_set
    assert any("7 points are results of a model" in line for line in trial.history)
    assert any("2 unlabelled" in line for line in trial.history)
    assert model_outputs(LABELS, {}) == ()


def test_one_prefix_is_removed(read):
    trial = read(file(labels=[f"Anna:{name}" for name in LABELS]))
    assert trial.markers.names == LABELS
    assert any("'Anna'" in line for line in trial.history)
    with pytest.raises(FileRefused, match="has no subject 'Berta'"):
        read(file(labels=[f"Anna:{name}" for name in LABELS]), subject="Berta")


def test_two_subjects_need_a_choice(read):
    points = np.concatenate([person(), person() + AWAY], axis=1)
    both = file(points, [f"{who}:{name}" for who in ("Anna", "Berta") for name in LABELS])
    with pytest.raises(FileRefused, match=r"2 subjects \(Anna, Berta\)"):
        read(both)
    trial = read(both, subject="berta")
    assert trial.markers.names == LABELS
    np.testing.assert_allclose(trial.markers.xyz, person() + AWAY, atol=1e-6)


@pytest.mark.parametrize("who", ["Anna:", ""])
@pytest.mark.parametrize("count", [3, 6])
def test_a_thing_with_a_few_markers_is_no_second_person(read, tmp_path, who, count):
    """A club of three to six markers beside a person whose labels have a prefix, or none."""
    points = np.concatenate([person(), person()[:, :count] + AWAY], axis=1)
    labels = [*(f"{who}{name}" for name in LABELS), *(f"club:c{k}" for k in range(count))]
    trial = read(file(points, labels))
    assert trial.markers.names == LABELS
    assert any(f"{count} points of club left out" in line for line in trial.history)
    (tmp_path / "club.c3d").write_bytes(file(points, labels).bytes())
    assert inspect_file(tmp_path / "club.c3d")["subjects"] == ([who[:-1]] if who else [])


def test_repeated_labels(read):
    empty, same, other = np.zeros((FRAMES, 1, 3)), person()[:, :1], person()[:, 1:2]
    for repetition in (empty, same):
        trial = read(file(np.concatenate([person(), repetition], axis=1), (*LABELS, LABELS[0])))
        assert trial.markers.names == LABELS
        assert any(f"{LABELS[0]} occurs 2 times" in line for line in trial.history)
    trial = read(file(np.concatenate([person(), other], axis=1), (*LABELS, LABELS[0])))
    assert set(trial.markers.names) - set(LABELS) == {f"{LABELS[0]}#1", f"{LABELS[0]}#2"}
    assert LABELS[0] in trial.warnings[0]


@pytest.mark.parametrize("per_metre", [1000.0, 100.0, 1.0])
def test_measures_in_any_unit(read, per_metre):
    group = {
        "Bodymass": real(65.0),
        "Height": real(1.75 * per_metre),
        "LLegLength": real(0.9 * per_metre),
        "RLegLength": real(0.0),
    }
    group |= {"LKneeWidth": real(0.11 * per_metre), "LThighRotation": real(3.0), "Note": text("mm")}
    trial = read(file(more={"PROCESSING": group}))
    assert trial.measurements == pytest.approx(
        {"Bodymass": 65.0, "Height": 1.75, "LLegLength": 0.9, "LKneeWidth": 0.11}, rel=1e-6
    )
    assert trial.warnings == ()


def test_an_impossible_measure_is_left_out_and_said(read):
    trial = read(file(more={"PROCESSING": {"Bodymass": real(6500.0), "Height": real(1750.0)}}))
    assert trial.measurements == {"Height": 1.75}
    assert "Bodymass = 6500" in trial.warnings[0]


def test_frames_without_a_rate_are_refused_but_one_frame_needs_none(read):
    recording = file()
    recording.rate = 0.0
    with pytest.raises(FileRefused, match="rate is 0"):
        read(recording)
    one = File(recording.points[:1], rate=0.0, parameters=recording.parameters)
    assert read(one).markers.time.tolist() == [0.0]


def test_a_file_without_markers_and_plates_is_still_a_trial(read):
    trial = read(File(np.empty((5, 0, 4)), np.ones((5, 2)), parameters={"POINT": {"UNITS": text("mm")}}))
    assert trial.markers is None
    assert trial.plates == ()
    assert "No markers." in trial.history


def test_source_and_role(read):
    recording = file(plates=True)
    recording.first = 286
    trial = read(recording, role="static")
    assert (trial.name, trial.role, trial.source.format, trial.source.rate) == ("trial", "static", "C3D", 100.0)
    assert (trial.source.analog_rate, trial.source.first_frame, len(trial.source.sha256)) == (1000.0, 286, 64)
    assert trial.markers.time[0] == trial.plates[0].wrench.time[0] == 0.0


STANDING = {
    "Nasion": 1.6,
    "C7x": 1.45,
    "Acr_R": 1.4,
    "Acr_L": 1.4,
    "K1": 0.5,
    "K2": 0.5,
    "R_Calc": 0.05,
    "L_Calc": 0.05,
}


def unknown_set(labels):
    """(T, K, 3) m of somebody who stands, in labels of a set that nobody described."""
    generator = np.random.default_rng(3)
    xyz = np.column_stack([generator.uniform(-0.2, 0.2, (len(labels), 2)), list(STANDING.values())])
    return np.repeat(xyz[None], FRAMES, axis=0)


@pytest.mark.parametrize("turn", [Z_UP, Y_UP, X_UP])
def test_head_over_feet_tells_the_vertical_in_any_set(read, turn):
    trial = read(file(unknown_set(STANDING), tuple(STANDING), turn=turn))
    np.testing.assert_allclose(trial.markers.xyz[..., 2], unknown_set(STANDING)[..., 2], atol=1e-6)
    assert not any("Up is" in line or "z assumed" in line for line in trial.warnings)


def test_somebody_who_would_lie_and_of_whom_nothing_tells_the_vertical_is_refused(read):
    numbers = tuple(f"M{i}" for i in range(len(STANDING)))
    with pytest.raises(FileRefused, match=r"along Y the markers are .* Write the upward axis into POINT:Y_SCREEN"):
        read(file(unknown_set(STANDING), numbers, turn=Y_UP))
    assert "z assumed" in read(file(unknown_set(STANDING), numbers)).warnings[0]


def test_corners_that_make_no_plate_have_no_vote_on_the_vertical(read):
    recording = file(unknown_set(STANDING), tuple(STANDING), plates=True)
    kind, shape, values = recording.parameters["FORCE_PLATFORM"]["CORNERS"]
    bent = np.array(values).reshape(4, 3)
    bent[1] = bent[0]
    bent[:, 1] = [0, 0, 900, 1800]
    recording.parameters["FORCE_PLATFORM"]["CORNERS"] = (kind, shape, tuple(bent[:, [0, 2, 1]].ravel()))
    trial = read(recording)
    np.testing.assert_allclose(trial.markers.xyz[..., 2], unknown_set(STANDING)[..., 2], atol=1e-6)
    assert trial.plates == ()


def test_a_file_of_muscles_alone_needs_no_unit_of_length(read):
    points = np.zeros((FRAMES, 0, 4))
    analog = np.random.default_rng(0).normal(size=(10 * FRAMES, 3))
    trial = read(File(points, analog, parameters={"POINT": {"UNITS": None, "LABELS": None}}))
    assert trial.markers is None
    assert any("holds no lengths" in line for line in trial.history)
