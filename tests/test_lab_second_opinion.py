"""Suspicious numbers are read again by ezc3d in a child process: agreement and disagreement are said, a crash or a
hang costs nothing.
"""

import numpy as np
import pytest
from c3d_files import DEC, INTEL, MIPS, File, real, text, whole

from biodance.errors import FileRefused
from biodance.lab.c3d import raw as second_opinion
from biodance.lab.c3d.raw import read_raw


def jumping(processor=INTEL, scale=0.5, **parameters):
    """Return 20 frames of 4 points, one of which jumps by 3 m, and 3 analog channels."""
    generator = np.random.default_rng(0)
    points = np.concatenate(
        [np.round(generator.uniform(100, 1500, (1, 4, 3)) + np.zeros((20, 4, 3))), np.zeros((20, 4, 1))], axis=2
    )
    points[10:, 0, 0] += 3000
    analog = np.abs(np.round(generator.normal(0, 300, (200, 3)))) + 1
    return File(points, analog, processor, scale, parameters=parameters)


@pytest.fixture
def read(tmp_path):
    def reading(file):
        (tmp_path / "file.c3d").write_bytes(file.bytes())
        return read_raw(tmp_path / "file.c3d")

    return reading


@pytest.mark.parametrize("scale", [-1.0, 0.5], ids=["floats", "integers"])
@pytest.mark.parametrize("processor", [INTEL, DEC])
def test_the_same_numbers_are_confirmed(read, processor, scale):
    raw = read(
        jumping(processor, scale, ANALOG={"OFFSET": whole(5, 6, 7), "SCALE": real(0.5, 2, 3), "GEN_SCALE": real(0.1)})
    )
    assert raw.warnings == (
        "Markers jump by more than 1 m between two frames in 1 places; ezc3d finds the same numbers.",
    )


@pytest.mark.parametrize(
    "known",
    [{"OFFSET": whole(-5, 6, 7)}, {"FORMAT": text("UNSIGNED"), "OFFSET": whole(-30000, 0, 0)}],
    ids=["negative offset", "unsigned"],
)
def test_what_ezc3d_is_known_to_read_wrong_is_not_held_against_the_file(read, known):
    assert read(jumping(ANALOG=known)).warnings[-1].endswith("ezc3d finds the same numbers.")


def test_what_ezc3d_does_not_read_stays_as_biodance_read_it(read):
    raw = read(jumping(MIPS))
    assert "ezc3d does not take the file (MIPS" in raw.warnings[0]
    assert raw.warnings[0].endswith("so only biodance has read these numbers.")
    assert raw.points[19, 0, 0] - raw.points[0, 0, 0] == pytest.approx(1500)  # 3000 steps of 0.5 mm


def test_a_file_on_which_ezc3d_crashes_is_read(read):
    raw = read(
        jumping(EXTRA={"NOTE": ("text", (), b"x")})
    )  # a text without dimension: ezc3d 1.7.2 dies of it (signal 11)
    assert "ezc3d crashes on the file (signal" in raw.warnings[0]
    assert raw.warnings[0].endswith("so only biodance has read these numbers.")


@pytest.mark.parametrize(
    ("child", "said"),
    [
        ("import os; os.abort()", "ezc3d crashes on the file (signal 6)"),
        ("import time; time.sleep(30)", "ezc3d gives no answer within 0.5 s"),
        ("raise ImportError('no ezc3d')", "ezc3d does not take the file (ImportError: no ezc3d)"),
    ],
)
def test_a_child_that_dies_hangs_or_fails_costs_nothing(read, monkeypatch, child, said):
    monkeypatch.setattr(second_opinion, "READ", child)
    monkeypatch.setattr(second_opinion, "_PATIENCE", 0.5)
    assert said in read(jumping()).warnings[0]


@pytest.mark.parametrize("line", ["points[0, 1, 7] += 1", "analogs[0, 2, 7] += 1", "points = points[:, 1:]"])
def test_other_numbers_refuse_the_file(read, monkeypatch, line):
    monkeypatch.setattr(second_opinion, "READ", second_opinion.READ.replace("numpy.save", f"{line}\nnumpy.save", 1))
    with pytest.raises(FileRefused, match="ezc3d reads other numbers than biodance"):
        read(jumping(scale=-1.0))


def test_a_file_without_smell_is_not_judged(read, monkeypatch):
    monkeypatch.setattr(second_opinion, "READ", "import os; os.abort()")
    file = jumping()
    file.points[10:, 0, 0] -= 3000
    assert read(file).warnings == ()
