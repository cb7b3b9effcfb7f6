"""A user's own table of segment parameters: refused with reasons, or the body it describes."""

import re
from pathlib import Path

import pytest

from biodance.body.human.human import human
from biodance.body.tables.anthropometry import COUNT, KINDS, read_segment_table
from biodance.body.tables.choice import reference
from biodance.errors import BiodanceError
from biodance.records import Subject

HEADER = "segment,sex,quantity,axis,value,unit\n"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            "segment,sex,value\n",
            r"lacks the column 'quantity'\. Legal are segment, sex, quantity, axis, value, unit, and optional study",
        ),
        (HEADER.replace("unit", "unit,colour"), "unknown column 'colour'"),
        (HEADER, "has no row"),
        (
            HEADER + "thigh,F,mas,,0.1,body_mass\n",
            r"row 2: the quantity is 'mas'\. Legal: mass, length, com, gyration, inertia",
        ),
        (HEADER + "thigh,W,mass,,0.1,body_mass\n", r"row 2: the sex is 'W'\. Legal: F, M, FM"),
        (HEADER + "thigh,F,mass,,0.1,percent\n", r"row 2: the unit of mass is 'percent'\. Legal: body_mass, kg"),
        (HEADER + "thigh,F,com,up,0.4,m\n", r"row 2: the axis of com is 'up'\. Legal: longitudinal, x, y, z"),
        (HEADER + "thigh,F,mass,,a lot,kg\n", r"row 2: the value of thigh is 'a lot', expected a number"),
        (HEADER + "thigh,F,mass,,nan,kg\n", "expected a number"),
        (HEADER + "thigh,F,mass,,-7,kg\n", "expected more than 0"),
        (HEADER + "thigh,F,mass,,7\n", r"row 2: has not 6 cells"),
        (HEADER + "thigh,F,mass,,7,kg\nthigh,FM,mass,,8,kg\n", r"row 3: thigh F mass stands twice"),
    ],
)
def test_a_users_table_with_a_mistake_is_refused(tmp_path, text: str, words: str) -> None:
    (tmp_path / "scan.csv").write_text(text)
    with pytest.raises(BiodanceError, match=words):
        read_segment_table(tmp_path / "scan.csv")


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        ("leg,F,mass,,7,kg\n", "'leg' is not a segment of the model. Legal: pelvis, thigh"),
        ("thigh,M,mass,,7,kg\n", "holds no row for sex F. Add rows, or write FM"),
        (
            "thigh,F,mass,,34,kg\n",
            "the masses given are 104.6 % of the body .two of each limb., expected less than 100",
        ),
        (
            "shank,F,gyration,x,0.2,m\nshank,F,gyration,z,0.01,m\nshank,F,gyration,y,0.01,m\n",
            "no body has the radii of gyration given for shank",
        ),
    ],
)
def test_a_users_table_that_is_no_body_is_refused(tmp_path, rows: str, words: str) -> None:
    (tmp_path / "scan.csv").write_text(HEADER + rows)
    with pytest.raises(BiodanceError, match=words):
        reference(str(tmp_path / "scan.csv"), Subject(65.0, 1.7, "F"))
    with pytest.raises(BiodanceError, match="there is no such table"):
        reference(str(tmp_path / "absent.csv"), Subject(65.0, 1.7, "F"))


def test_the_example_of_contributing_is_a_table(tmp_path) -> None:
    page = (Path(__file__).parent.parent / "CONTRIBUTING.md").read_text(encoding="utf-8")
    (example,) = re.findall(r"```\n(segment,sex,.*?)```", page, flags=re.DOTALL)
    (tmp_path / "scan.csv").write_text(example)
    assert human(Subject(64.0, 1.70, "F", 30.0), table=str(tmp_path / "scan.csv")).sip.of("left_thigh")[
        0
    ] == pytest.approx(8.1, rel=0.01)


def test_a_users_own_scan_becomes_the_body(tmp_path) -> None:
    rows = "thigh,F,mass,,8,kg\nthigh,F,length,,0.4,m\nthigh,F,com,y,-0.17,m\n"
    rows += "shank,F,com,x,0.05,length\nshank,F,gyration,x,0.11,m\n"
    (tmp_path / "scan.csv").write_text(HEADER + rows)
    subject = Subject(64.0, 1.70, "F", 30.0)
    found, base = reference(str(tmp_path / "scan.csv"), subject), reference("de_leva_1996", subject)
    assert found.segments["thigh"].mass == pytest.approx(8 / 64)
    assert found.lengths["thigh"] == 0.4
    assert found.segments["thigh"].com[1] == -0.17
    assert found.segments["shank"].com[0] == pytest.approx(0.05 * base.lengths["shank"] * 1.70 / base.stature)
    assert found.segments["shank"].inertia[0, 0] == pytest.approx(0.11**2)
    ratio = {kind: found.segments[kind].mass / base.segments[kind].mass for kind in KINDS if kind != "thigh"}
    assert max(ratio.values()) == pytest.approx(min(ratio.values())), (
        "what is not given keeps the other table's proportions"
    )
    assert sum(COUNT[kind] * found.segments[kind].mass for kind in KINDS) == pytest.approx(1.0)
    body = human(subject, table=str(tmp_path / "scan.csv"))
    assert body.sip.of("right_thigh")[0] == pytest.approx(8.0, rel=0.01)
    assert "trunk joint at the navel" in " ".join(body.notes)
