"""Faults written into copies of recordings: the change is what was asked for, everything else is the original, byte
by byte.
"""

from pathlib import Path

import numpy as np
import pytest
from hidden_faults import about_centre, standing_recording
from inject import inject

from biodance.errors import BiodanceError
from biodance.lab.c3d.raw import read_raw
from biodance.lab.read import read_trial
from biodance.records import Subject, Trial
from biodance.virtual_lab.faults.causes import fault_of, parse_cause
from biodance.virtual_lab.recording.laboratory import Laboratory, LabVisit

SUBJECT = Subject(60.0, 1.70, "F", 30.0)
CLOCK = (0.1, 0.9)
FAULTS = (
    "plate_gain:target=Fz,gain=0.04", "plate_offset:target=Mx,offset=8", "plate_position:target=plate1:x,shift=0.02",
    "plate_rotation:target=plate1:z,angle=0.07", "time_delay:delay=0.02", "labels_swapped:target=LKNE/RKNE",
)  # fmt: skip


def written(path: Path, out: Path, text: str) -> Trial:
    return read_trial(inject(path, out, fault_of(parse_cause(text), {path.stem: CLOCK})))


def simulated(folder: Path, plate_type: int, *texts: str) -> Path:
    return standing_recording(folder, *texts, visit=LabVisit(laboratory=Laboratory(plate_type=plate_type)))


@pytest.fixture(scope="module", params=[2, 4])
def clean(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[int, Path]:
    return request.param, simulated(tmp_path_factory.mktemp("clean") / "s", request.param)


@pytest.mark.parametrize("text", FAULTS, ids=lambda text: text.partition(":")[0])
def test_a_copy_with_a_fault_is_a_recording_with_that_fault(text: str, clean: tuple[int, Path], tmp_path: Path) -> None:
    kind, path = clean
    copy = written(path, tmp_path / path.name, text)
    again = read_trial(simulated(tmp_path / "s", kind, text))
    np.testing.assert_allclose(copy.plates[0].wrench.value, again.plates[0].wrench.value, atol=2e-3)
    np.testing.assert_allclose(copy.plates[0].corners, again.plates[0].corners, atol=1e-6)
    np.testing.assert_allclose(copy.markers["LKNE"], again.markers["LKNE"], atol=1e-6)


def test_a_drift_runs_with_the_clock_given(clean: tuple[int, Path], tmp_path: Path) -> None:
    _, path = clean
    change = (
        written(path, tmp_path / "c.c3d", "plate_drift:target=Fx,drift=9").wrench.value - read_trial(path).wrench.value
    )
    np.testing.assert_allclose(change[:, 0], 9 * (np.linspace(*CLOCK, len(change)) - 0.5), atol=2e-3)


def test_all_other_bytes_are_the_originals(clean: tuple[int, Path], tmp_path: Path) -> None:
    _, path = clean
    inject(path, tmp_path / "c.c3d", fault_of(parse_cause("plate_position:target=plate1:x,shift=0.02"), {}))
    one, two = path.read_bytes(), (tmp_path / "c.c3d").read_bytes()
    assert len(one) == len(two)
    assert 4 <= sum(a != b for a, b in zip(one, two, strict=True)) <= 16  # the x of four corners, four bytes each
    inject(path, tmp_path / "same.c3d", lambda recording: recording)
    assert one == (tmp_path / "same.c3d").read_bytes()


def test_what_does_not_fit_into_a_copy_is_refused(clean: tuple[int, Path], tmp_path: Path) -> None:
    _, path = clean
    with pytest.raises(BiodanceError, match="rates, lengths"):
        inject(path, tmp_path / "a.c3d", fault_of(parse_cause("frame_rate:ratio=1.2"), {}))
    inject(path, tmp_path / "b.c3d", lambda recording: recording)
    with pytest.raises(BiodanceError, match="exists already"):
        inject(path, tmp_path / "b.c3d", lambda recording: recording)


REAL = (
    "biomechzoo/HC030A/HC030A05.c3d",
    "biomechzoo/HC032A/HC032A01.c3d",
    "pycgm/Movement_trial.c3d",
    "adl_gait/2014001_C1_01.c3d",
)


@pytest.mark.parametrize("name", REAL)
def test_real_recordings_of_four_laboratories_take_faults(name: str, data: Path, tmp_path: Path) -> None:
    path = data / name
    before = read_trial(path)
    centre = before.plates[0].centre
    x = about_centre(before.plates[0], centre)
    gain = about_centre(written(path, tmp_path / "gain.c3d", "plate_gain:target=plate1:Fz,gain=0.04").plates[0], centre)
    np.testing.assert_allclose(gain - x, 0.04 * x * np.eye(6)[2], atol=0.05)
    moved = written(path, tmp_path / "moved.c3d", "plate_position:target=plate1:y,shift=0.02")
    np.testing.assert_allclose(moved.plates[0].centre - before.plates[0].centre, [0, 0.02, 0], atol=1e-6)
    np.testing.assert_allclose(about_centre(moved.plates[0], moved.plates[0].centre), x, atol=1e-3)
    late = about_centre(written(path, tmp_path / "late.c3d", "time_delay:delay=0.02").plates[0], centre)
    shift = 0.02 * before.plates[0].wrench.rate
    if shift == round(shift):
        np.testing.assert_allclose(
            late[round(shift) :], x[: -round(shift)], atol=0.6
        )  # the empty plate's mean moves a little
    raw = read_raw(path), read_raw(tmp_path / "late.c3d")
    np.testing.assert_array_equal(raw[0].points, raw[1].points)


def test_a_wrong_sign_of_fz_on_a_belt_is_turned_back_by_the_reader(data: Path, tmp_path: Path) -> None:
    path = data / "gaitalytics" / "treadmill_no_events.c3d"
    copy, before = written(path, tmp_path / "c.c3d", "axis_error:target=plate2:Fz"), read_trial(path)
    assert any("Fz alone was turned round" in one for one in copy.plates[1].decisions)
    assert not any("Two signs" in one for one in copy.warnings)
    for one, other in zip(copy.plates, before.plates, strict=True):
        np.testing.assert_allclose(one.wrench.value, other.wrench.value, atol=0.1)
