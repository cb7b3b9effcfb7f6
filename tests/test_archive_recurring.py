"""What no cause describes is compared over an archive: truth by construction."""

import json
from pathlib import Path

import numpy as np

from biodance.batch.summary import left_in_archive
from biodance.diagnosis.archive.alike import SessionLeft, likenesses

CELLS = [(channel, band) for channel in ("Fx", "Fy", "Fz", "Mx", "My", "Mz")
         for band in ((0.0, 0.04), (0.04, 0.3), (0.3, 1.0), (1.0, 2.5), (2.5, 6.0))]  # fmt: skip
LOOSE = {("Fy", (1.0, 2.5)): 9.0, ("Mx", (1.0, 2.5)): 14.0, ("Mx", (2.5, 6.0)): 11.0, ("Fy", (2.5, 6.0)): 7.0}


def session(seed: int, name: str, *, size: float = 0.0, plate: str = "plate2") -> SessionLeft:
    """Return what is left of a session: chance, and the trace of a loose plate of some size."""
    chance = np.random.default_rng(seed)
    left = {cell: float(abs(chance.normal(0, 1.2)) + size * LOOSE.get(cell, 0.0)) for cell in CELLS}
    return SessionLeft(name, frozenset({"plate1", plate}) if plate else frozenset({"plate1"}), left, told=not size)


def test_three_sessions_on_the_loose_plate_look_alike_and_say_where() -> None:
    loose = {12: 1.0, 40: 0.6, 41: 1.5}
    archive = [session(k, f"S{k:02d}", size=loose.get(k, 0.0)) for k in range(48)]
    found = {one.session: one for one in likenesses(archive)}
    assert set(found) == {"S12", "S40", "S41"}
    assert found["S41"].others == ("S12", "S40")
    assert set(found["S41"].plates) == {"plate1", "plate2"}
    assert {channel for channel, _ in found["S41"].cells} <= {"Fy", "Mx"}
    assert "looks like sessions S12 and S40 on the same plates" in found["S41"].text


def test_the_same_trace_on_another_plate_or_another_trace_is_not_alike() -> None:
    clean = [session(k, f"S{k:02d}") for k in range(10)]
    here = session(100, "here", size=1.0)
    elsewhere = SessionLeft("elsewhere", frozenset({"plate7"}), session(101, "", size=1.0).left, told=False)
    other = dict(session(102, "").left) | {("Fz", (0.04, 0.3)): 12.0, ("Mz", (0.0, 0.04)): 9.0}
    assert not likenesses([*clean, here, elsewhere])
    assert not likenesses([*clean, here, SessionLeft("other", here.plates, other, told=False)])


def test_chance_hardly_ever_makes_two_sessions_alike() -> None:
    alarms = 0
    for archive in range(100):
        drawn = [session(1000 * archive + k, f"S{k:02d}") for k in range(20)]
        open_ = [SessionLeft(one.session, one.plates, one.left, told=k > 7) for k, one in enumerate(drawn)]
        alarms += bool(likenesses(open_))
    assert alarms <= 2


def test_results_of_sessions_are_read_from_the_folder_of_the_archive(tmp_path: Path) -> None:
    for k in range(8):
        one = session(k, f"S{k}", size=1.0 if k in (2, 5) else 0.0)
        rows = [{"channel": channel, "band_hz": band, "z": z} for (channel, band), z in one.left.items()]
        document = {
            "trials": [{"plates": [{"name": name} for name in sorted(one.plates)]}],
            "diagnosis": {"verdict": "unexplained" if k in (2, 5) else "nothing wrong", "adequacy": rows},
        }
        folder = tmp_path / "sessions" / f"S{k}"
        folder.mkdir(parents=True)
        (folder / "results.json").write_text(json.dumps(document), encoding="utf-8")
    found = left_in_archive(tmp_path, [f"S{k}" for k in range(8)])
    assert [one.session for one in likenesses(found)] == ["S2", "S5"]
