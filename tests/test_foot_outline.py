"""Outlines of the feet: typed or traced, their soles and masses, refusals with a sentence."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from biodance.body.human.human import human
from biodance.errors import SessionRefused
from biodance.lab.session.file import read_session_file, traced_outline, typed_outline
from biodance.records import FootSizes, Subject

MAN = Subject(78.1, 1.777, "M", 30.0)
SIZES = {"length": 0.27, "breadth": 0.102, "heel_breadth": 0.07}


def _area(corners: np.ndarray) -> float:
    x, z = corners[:, 0], corners[:, 2]
    return 0.5 * abs(float(np.sum(x * np.roll(z, 1) - z * np.roll(x, 1))))


def test_the_sole_is_the_outline() -> None:
    wide = FootSizes(0.28, 0.12, 0.08)
    body = human(replace(MAN, foot_outline={"right": wide, "left": FootSizes(**SIZES)}))
    sole = body.feet["right"].outline
    assert np.ptp(sole[:, 0]) == pytest.approx(0.28)
    assert np.ptp(sole[:, 2]) == pytest.approx(0.12)
    assert np.ptp(body.feet["left"].outline[:, 0]) == pytest.approx(0.27)
    assert _area(sole) > _area(body.feet["left"].outline)


def test_larger_feet_weigh_more_and_are_known_better() -> None:
    table, given = (
        human(MAN),
        human(replace(MAN, foot_outline=dict.fromkeys(("right", "left"), FootSizes(0.30, 0.12, 0.085)))),
    )
    index = table.segment_index("right_foot")
    assert given.sip.mass[index] > 1.1 * table.sip.mass[index]
    sds = [np.sqrt(body.sip.covariance[10 * index, 10 * index]) for body in (table, given)]
    assert sds[1] < sds[0]
    assert given.sip.mass.sum() == pytest.approx(MAN.mass, rel=1e-12)
    assert given.girths == {"right_foot": ("foot outline",), "left_foot": ("foot outline",)}


def test_a_traced_ellipse_has_its_axes(tmp_path: Path) -> None:
    rows, angle = ["side,x_cm,y_cm"], np.linspace(0, 2 * np.pi, 200, endpoint=False)
    for side in ("right", "left"):
        rows += [f"{side},{13 * np.cos(a) + 5:.6f},{5 * np.sin(a):.6f}" for a in angle]
    file = tmp_path / "feet.csv"
    file.write_text("\n".join(rows))
    found = traced_outline(file)["left"]
    assert found.length == pytest.approx(0.26, abs=1e-4)
    assert found.breadth == pytest.approx(0.10, abs=1e-4)
    assert found.heel_breadth == pytest.approx(0.10 * np.sqrt(1 - 0.7**2), abs=1e-3)
    (tmp_path / "session.toml").write_text('[subject]\nfoot_outline = "feet.csv"\n')
    assert read_session_file(tmp_path).subject.outlines["right"].length == pytest.approx(0.26, abs=1e-4)


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({**SIZES, "lenght": 0.27}, "no size 'lenght'"),
        ({**SIZES, "length": 2.70}, "length = 270 cm is no foot's.*It looks like mm"),
        ({"length": 0.27}, "the right foot has no breadth and no heel_breadth"),
        ({**SIZES, "breadth": float("nan")}, "breadth = nan cm is no foot's"),
    ],
)
def test_what_cannot_be_a_foot_is_refused(given: dict[str, float], says: str) -> None:
    with pytest.raises(SessionRefused, match=says):
        typed_outline(given)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("foot,x,y\n", "needs the columns"),
        ("side,x_cm,y_cm\nright,0,0\n", "1 points of the right foot"),
        ("side,x_cm,y_cm\nright,a,0\n", "no number"),
    ],
)
def test_what_is_no_tracing_is_refused(text: str, says: str, tmp_path: Path) -> None:
    (tmp_path / "feet.csv").write_text(text)
    with pytest.raises(SessionRefused, match=says):
        traced_outline(tmp_path / "feet.csv")


def test_one_foot_may_differ() -> None:
    found = typed_outline({**SIZES, "right_length": 0.255})
    assert (found["right"].length, found["left"].length) == (0.255, 0.27)
    assert typed_outline({}) == {}
