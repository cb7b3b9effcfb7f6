"""A session folder with one good static trial and one file for every way in which a recording can be bad."""

from pathlib import Path

import numpy as np
from lab_sessions import MASS, STATURE, person, plate

from biodance.lab.c3d.write import PlateRecording, write_c3d
from biodance.records import Markers

CORNERS = np.array([[0.3, 0.25, 0.0], [-0.3, 0.25, 0.0], [-0.3, -0.25, 0.0], [0.3, -0.25, 0.0]])
UNREADABLE = ("empty", "text", "truncated")


def recording(corners: np.ndarray = CORNERS) -> PlateRecording:
    """Return a TYPE 2 plate under somebody who stands: z up in the lab, x forward, axes of the plate z down."""
    wrench = plate().wrench.value
    down = np.diag([1.0, -1.0, -1.0])
    channels = np.hstack([wrench[:, :3] @ down, wrench[:, 3:] @ down])
    order = [1, 0, 3, 2] if corners is CORNERS else [0, 1, 2, 3]
    return PlateRecording(2, corners[order], np.zeros(3), channels)


def write(path: Path, markers: Markers | None, *plates: PlateRecording) -> None:
    """Write a C3D file of markers and plates at 1000 Hz."""
    write_c3d(path, markers=markers, plates=plates, analog_rate=1000.0 if plates else 0.0)


def bad_session(folder: Path) -> Path:
    """Write the session and return its folder; every file but ``static`` and ``walk`` has its own fault."""
    folder.mkdir(parents=True)
    write(folder / "static.c3d", person(), recording())
    write(folder / "walk.c3d", person(seed=5), recording())
    (folder / "empty.c3d").write_bytes(b"")
    (folder / "text.c3d").write_text("time,Fx,Fy\n1,2,3\n" * 200)
    whole = (folder / "walk.c3d").read_bytes()
    (folder / "truncated.c3d").write_bytes(whole[: len(whole) // 3])
    write(folder / "no_plates.c3d", person(seed=6))
    write(folder / "no_markers.c3d", None, recording())
    strange = person(seed=7)
    write(
        folder / "unknown_set.c3d",
        Markers(tuple(f"P{i}" for i in range(len(strange.names))), strange.time, strange.xyz),
        recording(),
    )
    write(folder / "bow_tie.c3d", person(seed=8), recording(CORNERS[[0, 2, 1, 3]]))
    lines = ["[subject]", f"mass_kg = {MASS}", f"height_m = {STATURE}", 'sex = "F"', "age = 30"]
    (folder / "session.toml").write_text("\n".join(lines))
    return folder
