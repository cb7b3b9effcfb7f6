"""The one table of how wrong things are: every row with its source, every size in one place, each in its state."""

import ast
import re
from dataclasses import replace
from pathlib import Path

import pytest
from diagnosed_sessions import body, known, windows

import biodance
from biodance.body.parts import JointError
from biodance.body.tables.anthropometry import read_table
from biodance.body.tables.error_sizes import error_rows, error_size, joint_size
from biodance.diagnosis.candidates import candidates
from biodance.diagnosis.model import nuisances
from biodance.diagnosis.problem import problem
from biodance.effects import effect
from biodance.errors import UnknownName
from biodance.uncertainty.tolerances import BEFORE, in_state, key_of, table_sizes
from biodance.virtual_lab.person.skeleton import REALISTIC

CALIBRATED = replace(body(), joint_errors=(JointError("right_knee", 0.006, 0.04), JointError("trunk", 0.013, 0.0)))
TABLE = read_table("uncertainty", "sizes")
ROOMS = ("body", "motion", "uncertainty", "identification", "diagnosis", "virtual_lab", "dance", "pipeline", "effects")
SAYS_A_SIZE = re.compile(
    r"(^|_)(SD|SIDES|SLIDE|HINGE|JOINT_CENTRE|ROOT_CENTRE|TILT|TURN|FLOOR|GAIN|OFFSET|SOFT_TISSUE|FIXED_POINT)(_|$)"
)
CAUSES = ("plate_gain", "time_delay", "body_mass", "lab_tilt", "plate_position", "clock_drift", "joint_centre")
ELSEWHERE = {
    "body/human/scaling.py:_TILT": "deg, a warning's threshold",
    "body/human/skeleton.py:_HAND_TURN": "a joint's range",
    "virtual_lab/visit.py:tilt": "a fault that a visit is given, 0 by default",
    "body/similarity.py:_RELATIVE_MASS_SD": "robots: what a data sheet is worth",
    "body/similarity.py:_RELATIVE_INERTIA_SD": "robots",
    "body/similarity.py:_COM_SD": "robots",
    "body/similarity.py:_CENTRE_SD": "robots",
    "uncertainty/session_noise.py:_GAIN": "of a difference filter",
    "identification/physical.py:RELATIVE_FLOOR": "share of an eigenvalue",
}
"""Constants whose names sound like sizes and are none of this table's."""


def test_every_row_says_what_it_is_and_where_it_was_learned() -> None:
    seen = set()
    for row in TABLE.rows:
        assert row["source"].strip(), row
        assert row["unit"].strip(), row
        assert float(row["sd"]) >= 0
        for column in ("learned_on", "state", "whose"):
            assert row[column] in TABLE.provenance[column], (column, row)
        key = tuple(row[column] for column in ("quantity", "target", "state", "whose"))
        assert key not in seen, f"{key} stands twice"
        seen.add(key)
        if row["learned_on"] == "literature":
            assert re.search(r"\d{4}|tables|clinic|errors of predicted", row["source"]), row


@pytest.mark.parametrize(
    ("quantity", "target", "state", "expected"),
    [
        ("slide", "marker", "any", 0.006),  # Leardini 2005: 3 to 10 mm over a movement of about a radian
        ("joint_centre", "hip", "before", 0.012),  # Harrington 2007: 5 to 25 mm
        ("joint_centre", "trunk", "before", 0.040),  # tables cut the trunk 5 to 8 cm apart
        ("tilt", "knee", "before", 0.07),  # 4 degrees
        ("axis_turn", "knee medial marker", "before", 0.10),  # Della Croce 1999: 5 to 6 degrees
    ],
)
def test_the_sizes_on_which_every_interval_stands_are_those_of_their_sources(
    quantity: str, target: str, state: str, expected: float
) -> None:
    """A size is not measured by any other test: too small, and all intervals are too short."""
    assert error_size(quantity, target, state=state) == expected


def test_a_size_that_is_not_there_is_refused() -> None:
    assert error_size("joint_centre", "trunk", state="before") == 0.040
    assert error_size("joint_centre", "trunk", state="after") < 0.005
    assert joint_size("joint_centre", "left_hip") == joint_size("joint_centre", "hip") == 0.012
    assert joint_size("joint_centre", "tail") == error_size("joint_centre", "other", state="before")
    with pytest.raises(UnknownName):
        error_size("joint_centre", "trunk")
    with pytest.raises(UnknownName):
        error_size("fame", "any")


def constants(path: Path) -> list[str]:
    """Return the names in a module that are set to numbers: constants, and defaults of records."""
    tree, names = ast.parse(path.read_text(encoding="utf-8")), []
    for node in [*tree.body, *(inner for one in tree.body if isinstance(one, ast.ClassDef) for inner in one.body)]:
        targets = (
            node.targets if isinstance(node, ast.Assign) else [node.target] if isinstance(node, ast.AnnAssign) else []
        )
        value = getattr(node, "value", None)
        if value is None or not any(
            isinstance(x, ast.Constant) and isinstance(x.value, float) for x in ast.walk(value)
        ):
            continue
        names += [name.id for target in targets for name in ast.walk(target) if isinstance(name, ast.Name)]
    return names


def test_no_size_is_written_a_second_time() -> None:
    house = Path(biodance.__file__).parent
    quantities = {row["quantity"].upper() for row in TABLE.rows} - {
        "MARKER",
        "CAMERA",
        "SCALE",
        "SWAY",
        "COM",
        "PERFORMANCE",
    }
    found = set()
    for room in ROOMS:
        for path in sorted((house / room).rglob("*.py")):
            for name in constants(path):
                if SAYS_A_SIZE.search(name) or name.upper() in quantities:
                    found.add(f"{path.relative_to(house).as_posix()}:{name}")
    assert found == set(ELSEWHERE), "sizes belong into anthropometry/uncertainty/sizes.csv"


def test_the_virtual_laboratory_draws_from_its_own_rows() -> None:
    rows = {row["quantity"]: float(row["sd"]) for row in error_rows(whose="virtual")}
    assert rows == vars(REALISTIC)
    assert not {row["quantity"] for row in error_rows() if row["whose"] == "virtual"}


def test_units_of_learned_sizes_are_those_of_the_causes() -> None:
    for row in error_rows():
        if row["learned_on"] == "null_sessions" and row["quantity"] in CAUSES:
            assert row["unit"] == effect(row["quantity"]).parameters[0].unit, row


def test_slide_is_what_its_source_says() -> None:
    (row,) = (row for row in error_rows() if (row["quantity"], row["target"]) == ("slide", "marker"))
    assert float(row["sd"]) == 0.006
    low, high = map(float, re.search(r"(\d+) to (\d+) mm over a movement", row["source"]).groups())
    assert low < 1e3 * float(row["sd"]) * 1.0 < high, "mm at one radian, the excursion of a movement"
    assert "doi:10.1016/j.gaitpost.2004.05.002" in row["source"]


def test_joints_never_calibrated_have_the_sizes_before_calibration() -> None:
    sizes = table_sizes()
    assert in_state("joint_centre hip", "left_hip", CALIBRATED) == "joint_centre hip"
    assert in_state("joint_centre hip", "left_hip", body()) == "joint_centre hip" + BEFORE
    assert in_state("slide thigh", "", body()) == "slide thigh"
    for kind in ("hip", "knee", "trunk", "shoulder", "elbow"):
        assert sizes[f"joint_centre {kind}{BEFORE}"] > sizes[f"joint_centre {kind}"], kind
    assert sizes["tilt elbow" + BEFORE] > 3 * sizes["tilt elbow"]
    assert known().size("plate_gain Fx" + BEFORE) == known().size("plate_gain Fx") > 0


def test_diagnosis_asks_the_body_whether_its_joints_were_calibrated() -> None:
    put = problem(body(), windows(3, trials=1))
    there = problem(CALIBRATED, windows(3, trials=1))
    assert "tilt knee" not in put.groups
    assert put.groups.count("tilt knee" + BEFORE) == 4
    assert there.groups.count("tilt knee") == 4
    for one, expected in ((put, {BEFORE}), (there, {""})):
        found = nuisances(one, candidates(one, ("plate_gain",)))
        keys, means = found.keys, found.means
        assert {key.removeprefix("tilt knee") for key in keys if key.startswith("tilt knee")} == expected
        assert {key for key in keys if key.startswith("plate")} == {
            key_of("plate_gain", c) for c in ("Fx", "Fy", "Fz", "Mx", "My", "Mz")
        }
        assert len(means) == len(keys)
