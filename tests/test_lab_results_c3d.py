"""Results inside a copy of the recording: two readers find them and all of the original; nothing is overwritten, no
wrong copy stays.
"""

import ezc3d
import numpy as np
import pytest

from biodance.errors import FileRefused
from biodance.lab.c3d import results as results_c3d
from biodance.lab.c3d.raw import read_raw
from biodance.lab.c3d.results import Event, Output, write_results_c3d
from biodance.lab.c3d.write import PlateRecording, write_c3d
from biodance.lab.readers.c3d import read_c3d
from biodance.records import Markers

FRAMES, RATE = 50, 100.0
CORNERS = np.array([[0.4, 0.6, 0.0], [0.0, 0.6, 0.0], [0.0, 0.0, 0.0], [0.4, 0.0, 0.0]])
Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
"""file_R_lab of a laboratory with y up: z of the lab is y of the file, y of the lab -z."""


def record(path, *, turn=None, count=5, parameters=None):
    """Write a recording of ``count`` markers and one plate, in the lab's axes or turned, and return its path."""
    rng = np.random.default_rng(2)
    turn = np.eye(3) if turn is None else turn
    xyz = rng.uniform(0.2, 1.6, (1, count, 3)) + 0.01 * np.sin(np.arange(FRAMES) / 9)[:, None, None]
    xyz[3:5, 1] = np.nan
    wrench = rng.normal([0, 0, -600, 0, 0, 0], 1.0, (10 * FRAMES, 6))
    plate = PlateRecording(2, CORNERS @ turn.T, [0, 0, -0.04], wrench)
    markers = Markers(tuple(f"LAB{i}" for i in range(count)), np.arange(FRAMES) / RATE, xyz @ turn.T)
    write_c3d(path, markers=markers, plates=[plate], analog_rate=10 * RATE, first_frame=301, parameters=parameters)
    return path


def outputs():
    """Return random results, the fifth frame without any."""
    value = np.random.default_rng(5).normal(size=(4, FRAMES, 3))
    value[:, 4] = np.nan
    return [
        Output("RightHipAngles", "ANGLES", value[0], "flexion, adduction, rotation", turns=False),
        Output("RightHipMoments", "MOMENTS", value[1], "flexion, adduction, rotation", turns=False),
        Output("GroundForce", "FORCES", value[2], "x, y, z"),
        Output("BodyCentreOfMass", "MODELED_MARKERS", value[3], "x, y, z"),
    ]


EVENTS = (Event(0.105, "Right", "Foot Strike"), Event(0.4, "Left", "Foot Off"))


def test_two_readers_find_the_results_in_their_units(tmp_path):
    found, original = outputs(), record(tmp_path / "walk.c3d")
    path = write_results_c3d(
        tmp_path / "out.c3d", original, outputs=found, events=EVENTS, parameters={"MASS": [61.5, 2.5], "SOURCE": ["x"]}
    )
    ours, theirs = read_raw(path), ezc3d.c3d(str(path))
    points = theirs["data"]["points"][:3].transpose(2, 1, 0)
    for output, factor in zip(found, (180 / np.pi, 1.0, 1.0, 1000.0), strict=True):
        column, expected = ours.labels.index(output.label), factor * output.value
        np.testing.assert_allclose(ours.points[:, column], expected, rtol=1e-6)
        column = theirs["parameters"]["POINT"]["LABELS"]["value"].index(output.label)
        np.testing.assert_allclose(np.delete(points[:, column], 4, axis=0), np.delete(expected, 4, axis=0), rtol=1e-6)
    assert ours.parameters["POINT"]["ANGLES"] == ["RightHipAngles"]
    assert [ours.parameters["POINT"][f"{kind}_UNITS"] for kind in ("ANGLE", "FORCE", "MOMENT")] == [
        ["deg"],
        ["N"],
        ["Nm"],
    ]
    group = ours.parameters["BIODANCE"]
    assert (group["UNITS"], group["SOURCE"]) == (["deg", "Nm", "N", "mm"], ["x"])
    np.testing.assert_allclose(group["MASS"], [61.5, 2.5])
    event = theirs["parameters"]["EVENT"]
    assert (event["CONTEXTS"]["value"], event["LABELS"]["value"]) == (["Right", "Left"], ["Foot Strike", "Foot Off"])
    np.testing.assert_allclose(
        event["TIMES"]["value"], [[0, 0], [3.105, 3.4]], rtol=1e-6
    )  # frame 301 is 3 s after the lab's first


def test_the_original_is_in_it_as_it_was(tmp_path):
    original = record(tmp_path / "walk.c3d", count=300, parameters={"PROCESSING": {"Bodymass": 61.5}})
    path = write_results_c3d(tmp_path / "out.c3d", original, outputs=outputs(), events=EVENTS)
    before, after = read_c3d(original), read_c3d(path)
    assert after.markers.names == before.markers.names  # results are no markers
    np.testing.assert_array_equal(after.markers.xyz, before.markers.xyz)
    np.testing.assert_array_equal(after.wrench.value, before.wrench.value)
    assert (after.measurements, after.source.first_frame) == (before.measurements, before.source.first_frame)


def test_vectors_are_written_in_the_axes_of_the_file(tmp_path):
    found = outputs()
    original = record(tmp_path / "walk.c3d", turn=Y_UP, parameters={"POINT": {"Y_SCREEN": ["+Y"]}})
    assert "+Y of the file became +Z" in " ".join(read_c3d(original).history)
    raw = read_raw(write_results_c3d(tmp_path / "out.c3d", original, outputs=found))
    for output, expected in ((found[2], found[2].value @ Y_UP.T), (found[3], 1000 * found[3].value @ Y_UP.T)):
        np.testing.assert_allclose(raw.points[:, raw.labels.index(output.label)], expected, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(raw.points[:, raw.labels.index("RightHipMoments")], found[1].value, rtol=1e-6)


def test_the_units_that_the_file_declares_are_kept(tmp_path):
    original = record(tmp_path / "walk.c3d", parameters={"POINT": {"MOMENT_UNITS": ["Nmm"], "MOMENTS": ["LAB0"]}})
    raw = read_raw(write_results_c3d(tmp_path / "out.c3d", original, outputs=outputs()))
    column = raw.labels.index("RightHipMoments")
    np.testing.assert_allclose(raw.points[:, column], 1000 * outputs()[1].value, rtol=1e-6)
    assert raw.parameters["POINT"]["MOMENTS"] == ["LAB0", "RightHipMoments"]


def test_an_event_that_is_there_is_not_written_twice(tmp_path):
    original = record(tmp_path / "walk.c3d")
    first = write_results_c3d(tmp_path / "first.c3d", original, outputs=[], events=EVENTS)
    second = write_results_c3d(
        tmp_path / "second.c3d", first, outputs=outputs(), events=(*EVENTS, Event(0.45, "Right", "Foot Off"))
    )
    assert read_raw(second).parameters["EVENT"]["LABELS"] == ["Foot Strike", "Foot Off", "Foot Off"]


def test_an_empty_group_of_events_is_filled(tmp_path):
    original = record(tmp_path / "walk.c3d", parameters={"EVENT": {"USED": 0}})
    raw = read_raw(write_results_c3d(tmp_path / "out.c3d", original, outputs=[], events=EVENTS))
    assert raw.parameters["EVENT"]["CONTEXTS"] == ["Right", "Left"]


def test_what_does_not_fit_is_refused_and_nothing_is_overwritten(tmp_path):
    original, out = record(tmp_path / "walk.c3d"), tmp_path / "out.c3d"
    short = Output("A", "FORCES", np.zeros((3, 3)), "x, y, z")
    with pytest.raises(FileRefused, match="has 50 frames, A has 3"):
        write_results_c3d(out, original, outputs=[short])
    with pytest.raises(FileRefused, match="LAB0 already"):
        write_results_c3d(out, original, outputs=[Output("LAB0", "FORCES", np.zeros((FRAMES, 3)), "x, y, z")])
    out.write_bytes(b"mine")
    with pytest.raises(FileRefused, match="not overwritten"):
        write_results_c3d(out, original, outputs=outputs())
    assert out.read_bytes() == b"mine"


def test_a_copy_with_other_numbers_is_thrown_away(tmp_path, monkeypatch):
    original, other = record(tmp_path / "walk.c3d"), record(tmp_path / "other.c3d", count=6)
    run = results_c3d._run
    monkeypatch.setattr(results_c3d, "_run", lambda _, made, question: run(other, made, question))
    with pytest.raises(FileRefused, match="holds other numbers"):
        write_results_c3d(tmp_path / "out.c3d", original, outputs=outputs())
    assert not (tmp_path / "out.c3d").exists()


@pytest.mark.parametrize(("program", "why"), [("false", "ezc3d cannot copy it"), ("no-such-program", "gives no copy")])
def test_a_child_that_dies_is_a_refusal(tmp_path, monkeypatch, program, why):
    original = record(tmp_path / "walk.c3d")
    monkeypatch.setattr(results_c3d.sys, "executable", program)
    with pytest.raises(FileRefused, match=why):
        write_results_c3d(tmp_path / "out.c3d", original, outputs=outputs())
