"""A real walk of which only pelvis and legs are followed is compared with its body all the same."""

from dataclasses import replace
from pathlib import Path

import pytest
from inject import inject
from shared_markers import examined_beside, markers_asked_once

from biodance.diagnosis.diagnosis import Diagnosis
from biodance.lab.session.read import read_session
from biodance.pipeline.diagnosis import diagnose_session
from biodance.records import Session
from biodance.virtual_lab.causes import fault_of, parse_cause

LEGS = ("ASI", "PSI", "SACR", "THI", "KNE", "TIB", "ANK", "HEE", "TOE", "MMA", "KAX")


def of_legs(session: Session) -> Session:
    """Return a session without the markers of trunk, head and arms."""
    trials = []
    for one in session.trials:
        assert one.markers is not None
        kept = [name for name in one.markers.names if any(stem in name for stem in LEGS)]
        trials.append(replace(one, markers=one.markers.select(kept)))
    return replace(session, trials=tuple(trials))


def diagnosed(data: Path, folder: Path, text: str) -> Diagnosis:
    """Return the diagnosis of the legs of a child's walks with a fault in every file; "" for none."""
    source = data / "biomechzoo/HC044A"
    for path in sorted(source.glob("*.c3d")) if text else ():
        inject(path, folder / path.name, fault_of(parse_cause(text), {path.stem: (0.0, 1.0)}))
    result = examined_beside(of_legs(read_session(folder if text else source)))
    assert result.body is not None
    assert not result.body.free.all()
    with markers_asked_once():
        return diagnose_session(result).diagnosis


def test_legs_alone_of_a_faultless_walk_are_clean(data: Path, tmp_path: Path) -> None:
    found = diagnosed(data, tmp_path, "")
    assert (found.verdict, found.faults, found.why) == ("nothing wrong", (), {})


@pytest.mark.parametrize(
    ("text", "effect", "target", "size"),
    [
        ("plate_position:target=plate1:x,shift=0.02", "plate_position", "plate1:x", 0.02),
        ("plate_gain:target=plate1:Fz,gain=0.05", "plate_gain", "plate1:Fz", 0.05),
        ("labels_swapped:target=LASI/RASI", "labels_swapped", "LASI/RASI", None),
    ],
)
def test_legs_alone_show_a_fault(
    text: str, effect: str, target: str, size: float | None, data: Path, tmp_path: Path
) -> None:
    (first, *others) = diagnosed(data, tmp_path, text).faults
    assert (first.effect, first.target, others) == (effect, target, [])
    if size is not None:
        low, high = first.parameters[0].interval
        assert low <= size <= high
