"""A body survives its file without loss; what is no such file is refused in a sentence."""

import json
from dataclasses import replace

import numpy as np
import pytest

from biodance.body.body import body_text, read_body
from biodance.body.human.human import human
from biodance.body.parts import JointError
from biodance.body.similarity import hoap3
from biodance.errors import FileRefused
from biodance.records import Subject

WOMAN = human(Subject(58.3, 1.64, "F", 31.0))


def test_a_body_reads_back_exactly(tmp_path) -> None:
    path = tmp_path / "body.json"
    woman = replace(WOMAN, joint_errors=(JointError("right_elbow", 0.008, 0.12),))
    path.write_text(body_text(woman, "identified from dance"), encoding="utf-8")
    back, source = read_body(path)
    assert back.joint_errors == woman.joint_errors
    assert source == "identified from dance"
    assert (back.segments, back.notes, back.root) == (WOMAN.segments, WOMAN.notes, WOMAN.root)
    assert np.array_equal(back.sip.phi, WOMAN.sip.phi)
    assert np.array_equal(back.sip.covariance, WOMAN.sip.covariance)
    assert [j.name for j in back.joints] == [j.name for j in WOMAN.joints]
    assert all(np.array_equal(a.rotation, b.rotation) for a, b in zip(back.joints, WOMAN.joints, strict=True))
    assert np.array_equal(back.markers.position, WOMAN.markers.position)
    assert np.array_equal(back.feet["left"].outline, WOMAN.feet["left"].outline)
    assert np.array_equal(back.limits.torque_upper, WOMAN.limits.torque_upper)


def test_a_robot_without_markers_reads_back(tmp_path) -> None:
    path = tmp_path / "body.json"
    path.write_text(body_text(hoap3(), "the maker"), encoding="utf-8")
    back, _ = read_body(path)
    assert back.markers.names == ()
    assert back.markers.position.shape == (0, 3)
    assert np.array_equal(back.sip.phi, hoap3().sip.phi)


@pytest.mark.parametrize(
    ("text", "word"),
    [("{", "not a body"), ("[]", "not a body"), ("{}", "version"), ('{"biodance_body": 1}', "not a body")],
)
def test_another_file_is_refused(text: str, word: str, tmp_path) -> None:
    path = tmp_path / "body.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(FileRefused, match=word):
        read_body(path)
    with pytest.raises(FileRefused, match="cannot be read"):
        read_body(tmp_path / "none.json")


@pytest.mark.parametrize(
    ("where", "number"),
    [(place, number) for place in ("mass", "joint", "marker") for number in (np.nan, np.inf, 1e30)]
    + [("mass", -40.0), ("covariance", np.nan), ("covariance", np.inf)],
)
def test_a_number_of_no_body_is_refused_with_what_is_legal(where: str, number: float, tmp_path) -> None:
    raw = json.loads(body_text(WOMAN, "identified"))
    held, index = {
        "mass": (raw["sip"]["phi"], 0),
        "joint": (raw["joints"][3]["translation"], 1),
        "marker": (raw["markers"]["position"][2], 0),
        "covariance": (raw["sip"]["covariance"][5], 5),
    }[where]
    held[index] = number
    path = tmp_path / "body.json"
    path.write_text(json.dumps(raw), encoding="utf-8")
    with pytest.raises(FileRefused, match=r"is no number|legal are up to"):
        read_body(path)
