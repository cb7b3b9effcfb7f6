"""Real walks whose static trial was taken away: the body comes from a frame and the movement, and judges as before."""

from pathlib import Path

import pytest
from inject import inject
from shared_markers import examined_beside, markers_asked_once

from biodance.diagnosis.reasons import Reason
from biodance.lab.session.read import read_session
from biodance.pipeline.diagnosis import diagnose_session
from biodance.virtual_lab.causes import fault_of, parse_cause

FAULT = "plate_gain:target=plate1:Fz,gain=0.08"


def walks(data: Path, folder: Path, fault: str = "") -> Path:
    """Return a session of the walks of a child, with a fault written into their bytes, and no static trial."""
    for number, name in enumerate(("HC032A03.c3d", "HC032A18.c3d")):
        recorded, clock = data / "biomechzoo" / "HC032A" / name, {Path(name).stem: (number / 2, (number + 1) / 2)}
        if fault:
            inject(recorded, folder / name, fault_of(parse_cause(fault), clock))
        else:
            (folder / name).symlink_to(recorded)
    return folder


@pytest.mark.parametrize(("fault", "named"), [("", ()), (FAULT, (("plate_gain", "plate1:Fz"),))])
def test_walks_without_a_static_trial_are_compared_with_a_body(
    data: Path, tmp_path: Path, fault: str, named: tuple[tuple[str, str], ...]
) -> None:
    result = examined_beside(read_session(walks(data, tmp_path, fault)))
    assert result.scaled
    with markers_asked_once():
        found = diagnose_session(result).diagnosis
    assert Reason.BODY_NOT_SCALED not in found.why
    assert tuple((one.effect, one.target) for one in found.findings) == named
    assert found.adequacy  # the forces were compared with the simulation
