"""Faults written into the bytes of real walks are named by the observers, and clean walks stay missing."""

from pathlib import Path

import pytest
from inferred_sessions import heard
from inject import inject

from biodance.diagnosis.diagnosis import Finding
from biodance.lab.session.read import read_session
from biodance.pipeline.diagnosis import diagnose_session
from biodance.pipeline.session import examine
from biodance.virtual_lab.faults.causes import fault_of, parse_cause


def spoiled(session: Path, folder: Path, text: str) -> Path:
    """Return a copy of a session with a fault in every file."""
    for path in sorted(session.glob("*.c3d")):
        inject(path, folder / path.name, fault_of(parse_cause(text), {path.stem: (0.0, 1.0)}))
    return folder


def named_in(folder: Path) -> tuple[Finding, ...]:
    return heard(read_session(folder)).diagnosis.findings


@pytest.mark.parametrize("name", ["HC038A", "HC050A"])
def test_clean_walks_of_children_name_nothing(name: str, data: Path) -> None:
    assert named_in(data / "biomechzoo" / name) == ()


@pytest.mark.parametrize(
    ("name", "text", "effect", "target", "size"),
    [
        ("HC030A", "plate_position:target=plate1:x,shift=0.02", "plate_position", "plate1:x", 0.02),
        ("HC032A", "time_delay:delay=0.03", "time_delay", "", 0.03),
        ("HC055A", "plate_gain:target=plate1:Fz,gain=0.05", "plate_gain", "plate1:Fz", 0.05),
        ("HC044A", "axis_error:target=plate1:Fz", "axis_error", "plate1:Fz", None),
    ],
)
def test_a_fault_in_real_walks_is_named(
    name: str, text: str, effect: str, target: str, size: float | None, data: Path, tmp_path: Path
) -> None:
    (first, *others) = named_in(spoiled(data / "biomechzoo" / name, tmp_path, text))
    assert (first.effect, first.target, others) == (effect, target, [])
    if size is not None:
        low, high = first.parameters[0].interval
        assert low <= size <= high


def test_a_late_force_never_hides_itself(data: Path, tmp_path: Path) -> None:
    """The contact rules leave no run of such walks: the session is diagnosed all the same, and says what it heard."""
    late = spoiled(data / "biomechzoo/HC050A", tmp_path, "time_delay:delay=0.03")
    found = diagnose_session(examine(read_session(late))).diagnosis
    assert [one.effect for one in found.findings if one.effect != "labels_swapped"] == ["time_delay"]
    assert found.verdict == "named, incomplete"
    assert found.attention[0].text.startswith("2 things are wrong. First, LWRA and LWRB")
    steps = {row.trial: row.seconds for row in found.judged if row.why_not.startswith("only by its steps")}
    assert set(steps) == {"HC050A11", "HC050A33"}
    assert all(0.3 < seconds < 2.0 for seconds in steps.values())
