"""Plates of real laboratories against a second source: the scale in the clinic, the maker's own export, the feet."""

import numpy as np
import pytest

from biodance.lab.markers.upright import standing_mass
from biodance.lab.readers.c3d import read_c3d


@pytest.mark.parametrize("subject", ["HC030A", "HC032A", "HC038A"])
def test_static_weight_is_the_declared_mass(data, subject):
    trial = read_c3d(data / "biomechzoo" / subject / f"{subject}01.c3d", role="static")
    assert standing_mass(trial) == pytest.approx(trial.measurements["Bodymass"], rel=0.003)
    assert any("its sign was turned" in said for said in trial.plates[0].decisions)


def makers_text(path):
    lines = path.read_text(encoding="latin-1").splitlines()
    start = next(i for i, line in enumerate(lines) if line.startswith("abs time"))
    rows = np.array([[float(x) for x in line.split("\t")] for line in lines[start + 2 :] if line.strip()])
    return dict(zip(lines[start].split("\t"), rows.T, strict=True))


@pytest.mark.parametrize(
    ("name", "largest", "typical"), [("kistler_COP", 2e-4, 1e-4), ("kistler_CMJ_1plate", 7e-3, 6e-4)]
)
def test_an_eight_channel_plate_agrees_with_its_makers_export(data, name, largest, typical):
    """The jump is compared above 50 N; there the maker keeps a zero of half a newton that is taken off here."""
    truth = makers_text(data / "biomdp" / f"{name}.txt")
    plate = read_c3d(data / "biomdp" / f"{name}.c3d").plates[0]
    at = np.round(truth["abs time"] * plate.wrench.rate).astype(int)
    measured = np.isfinite(plate.wrench.value[at, 2])  # 20 ms at both ends of one file are padding
    at, truth = at[measured], {name: values[measured] for name, values in truth.items()}
    assert measured.mean() > 0.99
    along_plate = -(
        plate.wrench.cop(threshold=50)[at, :2] - plate.centre[:2]
    )  # its x, y point along -x, -y of the file
    error = along_plate - np.column_stack([truth["Ax"], truth["Ay"]])
    error = error[(truth["Fz"] > 51)]
    assert np.abs(error.mean(axis=0)).max() < 1e-3
    assert np.sqrt((error**2).mean(axis=0)).max() < typical
    assert np.abs(error).max() < largest
    np.testing.assert_allclose(plate.wrench.force[at, 2], truth["Fz"], atol=0.6)


def test_stairs_are_zeroed_and_the_weight_of_whole_steps_is_the_persons(data):
    """Over three whole steps of a climb the mean force is the weight: 833 N. As recorded it is 3.5 % more, which is
    the plates' offsets.
    """
    trial = read_c3d(data / "pycgm" / "Movement_trial.c3d")
    np.testing.assert_allclose([p.height for p in trial.plates], [0, 0.1955, 0.3889, 0.5838], atol=1e-3)
    vertical = trial.wrench.force[:, 2]
    weight = trial.measurements["Bodymass"] * 9.80665
    assert vertical[540:2160].mean() == pytest.approx(weight, rel=0.02)
    assert vertical.max() == pytest.approx(1388, abs=5)


def test_a_static_beside_the_plates_carries_nothing(data):
    trial = read_c3d(data / "pycgm" / "Static_trial.c3d", role="static")
    assert abs(trial.wrench.force[:, 2].mean()) < 0.1
    assert standing_mass(trial) is None
    assert all("Never loaded" in plate.decisions[-1] for plate in trial.plates)


def test_plates_of_other_laboratories(data):
    gait = read_c3d(data / "adl_gait" / "2014001_C1_01.c3d")
    assert gait.wrench.force[:, 2].max() == pytest.approx(791, abs=1)
    static = read_c3d(data / "c3d_parser" / "static" / "CB_Static0001.c3d", role="static")
    assert [p.type for p in static.plates] == [4, 4]
    assert standing_mass(static) == pytest.approx(36.3, abs=0.05)
    assert read_c3d(data / "adl_gait" / "2014001_ST.c3d", role="static").plates == ()


@pytest.mark.parametrize(
    "pattern", ["biomechzoo/*/*.c3d", "adl_gait/*_C1_*.c3d", "c3d_parser/*/*.c3d", "pycgm/Movement*.c3d"]
)
def test_every_load_lies_under_a_foot(data, pattern):
    paths = sorted(data.glob(pattern))
    assert paths
    for path in paths:
        for plate in read_c3d(path).plates:
            said = [text for text in plate.decisions if "from the feet" in text]
            if "Never loaded" not in plate.decisions[-1]:
                assert said, f"{path.name}, {plate.name}"
                assert float(said[0].split(" mm")[0].split()[-1]) < 25
