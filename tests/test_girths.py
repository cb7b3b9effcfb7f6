"""Girths of a person: exact solids, refusals with a sentence, and a prior that covers people it was not made of."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from generated_people import GeneratedPerson, generate_person, measured_lengths

from biodance.body.body import parse_body
from biodance.body.human.human import human, prior
from biodance.body.human.opinions import stack_volume
from biodance.body.human.skeleton import SEGMENTS, generic_skeleton
from biodance.body.tables.choice import reference
from biodance.errors import SessionRefused
from biodance.lab.session.file import legal_girths, read_session_file, usual_girths
from biodance.records import Sip, Subject
from biodance.settings import Settings
from biodance.uncertainty.caution import widened_prior

FEW = ("thigh", "shank", "upper_arm", "forearm", "waist", "hip", "chest")
MAN = Subject(78.1, 1.777, "M", 30.0)


def test_a_cone_of_circles_has_the_closed_form_of_hanavan() -> None:
    low, high, length = 0.05, 0.09, 0.4
    found = stack_volume([0, 1], 2 * np.pi * np.array([high, low]), [1, 1], length=length)
    assert found == pytest.approx(math.pi * length / 3 * (high**2 + high * low + low**2), rel=1e-12)


def test_a_prism_of_stadia_has_the_volume_that_trimesh_says() -> None:
    from trimesh.convex import convex_hull

    radius = 0.9 / (2 * math.pi + 4 * 0.4)  # girth 0.9 m, 1.4 times as broad as deep
    half, angle = 0.4 * radius, np.linspace(0, 2 * math.pi, 1600)
    edge = [radius * np.cos(angle), np.zeros(1600), radius * np.sin(angle) + half * np.sign(np.sin(angle))]
    mesh = convex_hull(np.concatenate([np.transpose(edge), np.transpose(edge) - [0, 0.3, 0]]))
    found = stack_volume([0, 0.4, 1], [0.9] * 3, [1.4] * 3, length=0.3)
    assert found == pytest.approx(mesh.volume, rel=1e-5)


def test_a_cylinder_is_the_same_in_one_piece_and_in_many() -> None:
    one, many = (stack_volume(np.linspace(0, 1, n), [0.5] * n, [1.2] * n, length=0.4) for n in (2, 9))
    assert many == pytest.approx(one, rel=1e-12)


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"thihg": 0.54}, "Did you mean 'thigh'"),
        ({"thigh": 5.40}, "It looks like mm: write 54.0"),
        ({"thigh": 0.0054}, "It looks like m: write 54.0"),
        ({"thigh": float("nan")}, "thigh = nan cm is no person's"),
        ({"right_waist": 0.8}, "no girth 'right_waist'"),
        ({"calf": 0.37, "shank": 0.37}, "given twice"),
    ],
)
def test_what_cannot_be_a_girth_is_refused_with_what_to_write(given: dict[str, float], says: str) -> None:
    with pytest.raises(SessionRefused, match=says):
        legal_girths(given)


def test_girths_that_contradict_the_mass_are_refused() -> None:
    thick = {name: 1.25 * girth for name, girth in usual_girths().items()}
    with pytest.raises(SessionRefused, match=r"the girths make a body of .* kg, but the body mass is 78.1 kg"):
        human(replace(MAN, girths=thick))


def test_session_file_gives_girths_in_metres(tmp_path: Path) -> None:
    file = tmp_path / "session.toml"
    file.write_text("[subject]\ngirths_cm = {thigh = 54, right_calf = 37.5}\n")
    assert read_session_file(tmp_path).subject.girths == pytest.approx({"thigh": 0.54, "right_shank": 0.375})
    file.write_text("[subject]\ngirths_cm = {thigh = 540}\n")
    with pytest.raises(SessionRefused, match=r"session.toml: \[subject\] girths_cm: thigh = 540 cm .* write 54.0"):
        read_session_file(tmp_path)
    file.write_text('[subject]\ngirths_cm = {thigh = "54"}\n')
    with pytest.raises(SessionRefused, match="thigh"):
        read_session_file(tmp_path)


def test_a_thicker_right_thigh_is_heavier_and_the_total_stays() -> None:
    thigh = usual_girths()["thigh"]
    usual, thick = (human(replace(MAN, girths={"thigh": thigh, "right_thigh": f * thigh})) for f in (1.0, 1.06))
    change = dict(zip(usual.segments, thick.sip.mass - usual.sip.mass, strict=True))
    assert change["right_thigh"] > 0.15
    assert change["right_thigh"] > change["left_thigh"]
    assert change["trunk_head"] < 0
    for body in (usual, thick):
        assert body.sip.mass.sum() == pytest.approx(MAN.mass, rel=1e-12)
        assert body.girths == {"right_thigh": ("thigh",), "left_thigh": ("thigh",)}
        assert any(note.startswith("Shapes of the person weigh beside the table") for note in body.notes)


def test_what_no_girth_speaks_of_keeps_the_tables_opinion() -> None:
    table, given = human(MAN), human(replace(MAN, girths={"shank": 0.40}))
    for segment in ("right_foot", "left_upper_arm", "right_forearm_hand"):
        index = table.segment_index(segment)
        assert given.sip.mass[index] == pytest.approx(table.sip.mass[index], rel=0.01)
    assert not table.girths


def test_body_file_keeps_the_girths() -> None:
    from biodance.body.body import body_text

    body = human(replace(MAN, girths={"thigh": 0.5}))
    assert parse_body(body_text(body, source="test"), "here")[0].girths == body.girths


def priors(person: GeneratedPerson, rng: np.random.Generator) -> list[Sip]:
    """Return what is known beforehand: by the table, with seven girths, with all."""
    mass = person.mass + rng.normal(0, 0.1)
    given: list[dict[str, float]] = [{}, {name: person.girths[name] for name in FEW}, person.girths]
    found = []
    for girths in given:
        subject = Subject(mass, person.stature, person.sex, 30.0, girths=girths)
        usual = reference(Settings.table, subject)
        found.append(prior(usual, measured_lengths(person, generic_skeleton(usual, subject), rng), subject))
    return found


def compared(seeds: range) -> tuple[np.ndarray, np.ndarray]:
    """Return errors and standard deviations (people, 3, 12) kg of the masses: table, seven girths, all girths; as
    identification takes them, without the people whose girths are refused.
    """
    errors, sds = [], []
    for seed in seeds:
        person = generate_person(seed)
        truth = np.array([person.masses[segment] for segment in SEGMENTS])
        try:
            found = [widened_prior(sip) for sip in priors(person, np.random.default_rng(seed))]
        except SessionRefused:
            continue
        errors.append([sip.mass - truth for sip in found])
        sds.append([np.sqrt(np.diag(sip.covariance)[::10]) for sip in found])
    return np.array(errors), np.array(sds)


def test_prior_with_girths_covers_people_it_was_not_made_of() -> None:
    error, sd = compared(range(401, 411))
    table, few, full = (np.sqrt(np.mean(error[:, way] ** 2)) for way in range(3))
    assert max(few, full) < 0.75 * table
    assert np.mean(sd[:, 2] / sd[:, 0]) < 0.75
    assert 0.88 < np.mean(np.abs(error[:, 2]) <= 1.96 * sd[:, 2]) < 0.99
