"""Joint centres from markers and widths: formulas at round numbers, and Vicon's own centres in its static files."""

from pathlib import Path

import numpy as np
import pytest

from biodance.body.human.measures import chord, davis_hip, elbow, harrington_hip, pelvis_frame, shoulder, unit, wrist
from biodance.lab.c3d.raw import read_raw

STATICS = {
    "pycgm": "Static_trial",
    "biomechzoo/HC030A": "HC030A01",
    "biomechzoo/HC032A": "HC032A01",
    "biomechzoo/HC038A": "HC038A01",
}


def test_chord_gives_the_distance_and_lies_in_the_plane() -> None:
    rng = np.random.default_rng(0)
    hip, knee_marker, wand = rng.normal(size=(3, 3))
    centre = chord(hip, knee_marker, 0.05, wand)
    assert np.linalg.norm(centre - knee_marker) == pytest.approx(0.05)
    assert (centre - hip) @ (centre - knee_marker) == pytest.approx(0.0, abs=1e-9)
    assert abs(np.linalg.det(np.stack([centre - hip, knee_marker - hip, wand - hip]))) < 1e-9


def test_hip_formulas_at_round_numbers() -> None:
    # Davis 1991 with LL 900, PW 240, AsisTroc 70, r 7 mm; Harrington 2007 with PW 240, PD 150 mm; ISB axes: x ahead, y
    # up, z right
    c, theta, beta = 0.115 * 900 - 15.3, 0.5, 0.314
    ahead = c * np.cos(theta) * np.sin(beta) - 77 * np.cos(beta)
    up = -c * np.cos(theta) * np.cos(beta) - 77 * np.sin(beta)
    np.testing.assert_allclose(
        1e3 * davis_hip(0.240, 0.900, 0.070, 0.007), [ahead, up, -(c * np.sin(theta) - 120)], atol=1e-6
    )
    np.testing.assert_allclose(
        1e3 * harrington_hip(0.240, 0.150), [-0.24 * 150 - 9.9, -0.30 * 240 - 10.9, 0.33 * 240 + 7.3], atol=1e-6
    )


@pytest.mark.parametrize("folder", sorted(STATICS))
def test_davis_is_vicons_own_hip_centre(folder: str, data: Path) -> None:
    """With the measures that Vicon used, our formula gives Vicon's hip centre (LFEP, RFEP) in its own static file."""
    raw = read_raw(data / folder / f"{STATICS[folder]}.c3d")
    typed = {
        name: float(np.ravel(value)[0]) / 1e3
        for name, value in raw.parameters["PROCESSING"].items()
        if np.size(value) == 1
    }

    def point(label: str) -> np.ndarray:
        return np.nanmean(raw.points[:, raw.labels.index(label)], axis=0) / 1e3

    back = point("SACR") if "SACR" in raw.labels else (point("LPSI") + point("RPSI")) / 2
    rotation, middle = pelvis_frame(point("RASI"), point("LASI"), back)
    width = typed.get("INTERASISDISTANCE", float(np.linalg.norm(point("RASI") - point("LASI"))))
    legs, radius = (typed["LLEGLENGTH"] + typed["RLEGLENGTH"]) / 2, typed.get("MARKERDIAMETER", 0.014) / 2
    for side, sign in (("R", 1.0), ("L", -1.0)):
        local = davis_hip(width, legs, typed[f"{side}ASISTROCANTERDISTANCE"], radius) * [1, 1, sign]
        distance = np.linalg.norm(middle + rotation @ local - point(f"{side}FEP"))
        assert distance < 1e-5


@pytest.mark.parametrize("folder", sorted(STATICS))
def test_knee_ankle_shoulder_elbow_and_wrist_are_vicons_own(folder: str, data: Path) -> None:
    """Each construction, from Vicon's own proximal centre and typed widths, gives Vicon's centre in its own static
    file.
    """
    raw = read_raw(data / folder / f"{STATICS[folder]}.c3d")
    typed = {
        name: float(np.ravel(value)[0]) / 1e3
        for name, value in raw.parameters["PROCESSING"].items()
        if np.size(value) == 1
    }
    at = {label: raw.points[raw.points.shape[0] // 2, i] / 1e3 for i, label in enumerate(raw.labels)}
    radius = typed.get("MARKERDIAMETER", 0.014) / 2
    up, ahead = at["CLAV"] + at["C7"] - at["STRN"] - at["T10"], at["CLAV"] + at["STRN"] - at["C7"] - at["T10"]
    forward = unit(np.cross(np.cross(up, ahead), up))
    for side, sign in (("R", 1.0), ("L", -1.0)):

        def reach(joint: str, side: str = side) -> float:
            return typed[f"{side}{joint}WIDTH"] / 2 + radius

        middle = (at[f"{side}WRA"] + at[f"{side}WRB"]) / 2
        offset = typed[f"{side}SHOULDEROFFSET"] + radius
        found = {
            "FEO": chord(at[f"{side}FEP"], at[f"{side}KNE"], reach("KNEE"), at[f"{side}THI"]),
            "TIO": chord(at[f"{side}FEO"], at[f"{side}ANK"], reach("ANKLE"), at[f"{side}TIB"]),
            "CLO": shoulder(at["CLAV"] - radius * forward, forward, at[f"{side}SHO"], offset, side=sign),
            "HUO": elbow(at[f"{side}CLO"], at[f"{side}ELB"], middle, reach("ELBOW"), side=sign),
            "RAO": wrist(at[f"{side}HUO"], at[f"{side}WRA"], at[f"{side}WRB"], reach("WRIST"), side=sign),
        }
        for centre, place in found.items():
            assert np.linalg.norm(place - at[side + centre]) < 1e-4, side + centre
