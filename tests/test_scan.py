"""A scanned person: exact cuts, masses of solids that nothing here cuts, refusals with a sentence."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scanned_people import ScannedPerson, measured_skeleton, scanned_person
from trimesh.triangles import mass_properties

from biodance.body.human.human import prior
from biodance.body.human.scan import clip_surface, cut_scan, cut_section, read_scan
from biodance.body.human.skeleton import SEGMENTS
from biodance.body.tables.choice import reference
from biodance.errors import SessionRefused
from biodance.lab.session.file import read_session_file
from biodance.records import Subject
from biodance.settings import Settings

TILTED = np.array([0.6, 0.0, 0.8])
Z = np.array([0.0, 0.0, 1.0])


@pytest.fixture(scope="module")
def person(tmp_path_factory: pytest.TempPathFactory) -> tuple[ScannedPerson, Path]:
    scanned = scanned_person(8)
    path = tmp_path_factory.mktemp("scan") / "body.ply"
    scanned.mesh.export(path)
    return scanned, path


def test_two_parts_of_a_torus_make_the_whole() -> None:
    whole = np.asarray(trimesh.creation.torus(0.5, 0.2).triangles)
    point = np.array([0.1, 0.2, 0.05])
    parts = [mass_properties(clip_surface(whole, point, sign * TILTED)) for sign in (1, -1)]
    assert sum(part.volume for part in parts) == pytest.approx(mass_properties(whole).volume, rel=1e-12)
    moment = sum(part.volume * part.center_mass for part in parts)
    np.testing.assert_allclose(moment, 0.0, atol=1e-12)


def test_a_cut_box_has_the_closed_form() -> None:
    box, point = np.asarray(trimesh.creation.box((1, 2, 3)).triangles), np.array([0.3, 0.2, 0.7])
    top = mass_properties(clip_surface(box, point, Z), density=2.0)
    assert top.mass == pytest.approx(2 * 1 * 2 * 0.8)
    np.testing.assert_allclose(top.center_mass, [0, 0, 1.1], atol=1e-12)
    np.testing.assert_allclose(np.diag(top.inertia), top.mass / 12 * np.array([4.64, 1.64, 5.0]), rtol=1e-9)
    section = cut_section(box, point, Z)
    assert section.area == pytest.approx(2.0)
    np.testing.assert_allclose(section.middle, [0, 0, 0.7], atol=1e-12)


def test_segments_of_a_scan_weigh_what_the_solids_weigh(person: tuple[ScannedPerson, Path]) -> None:
    scanned, path = person
    subject = Subject(scanned.person.mass, scanned.person.stature, scanned.person.sex, 30.0)
    bones = measured_skeleton(scanned, subject, np.random.default_rng(8))
    found = cut_scan(read_scan(str(path), subject.stature), bones)
    for name in SEGMENTS:
        assert found.lumps[name].mass == pytest.approx(scanned.person.masses[name], rel=0.16), name
        along = found.lumps[name].com - scanned.com[name]
        assert np.abs(along).max() < 0.04, name
    assert sum(lump.mass for lump in found.lumps.values()) == pytest.approx(scanned.person.mass, rel=0.08)


def test_a_scan_beats_the_table_and_keeps_the_total(person: tuple[ScannedPerson, Path]) -> None:
    scanned, path = person
    plain = Subject(scanned.person.mass, scanned.person.stature, scanned.person.sex, 30.0)
    bones = measured_skeleton(scanned, plain, np.random.default_rng(8))
    usual = reference(Settings.table, plain)
    table, given = (prior(usual, bones, one) for one in (plain, replace(plain, scan=str(path))))
    true = np.array([scanned.person.masses[name] for name in SEGMENTS])
    errors = [np.sqrt(np.mean((sip.mass - true) ** 2)) for sip in (table, given)]
    assert errors[1] < 0.6 * errors[0]
    assert given.mass.sum() == pytest.approx(plain.mass, rel=1e-9)
    assert given.measured == SEGMENTS
    assert np.linalg.eigvalsh(given.covariance).min() > -1e-9


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda mesh: mesh.apply_scale(1000), "It looks like millimetres"),
        (lambda mesh: mesh.apply_scale(0.8), "Is it the same person"),
        (
            lambda mesh: mesh.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0])),
            'a person who lies, or a file whose axis y points up: then write scan_up = "y"',
        ),
        (lambda mesh: mesh.update_faces(np.arange(len(mesh.faces)) > 3), "is not closed"),
    ],
)
def test_what_is_no_scan_of_this_person_is_refused(
    person: tuple[ScannedPerson, Path], change: object, says: str, tmp_path: Path
) -> None:
    mesh = trimesh.load(person[1], force="mesh")
    change(mesh)  # type: ignore[operator]
    mesh.export(tmp_path / "body.stl")
    with pytest.raises(SessionRefused, match=says):
        read_scan(str(tmp_path / "body.stl"), person[0].person.stature)


def test_arms_at_the_sides_and_missing_feet_are_refused(person: tuple[ScannedPerson, Path], tmp_path: Path) -> None:
    stature = person[0].person.stature
    post = trimesh.creation.cylinder(0.15, stature)
    post.export(tmp_path / "post.ply")
    with pytest.raises(SessionRefused, match="has no feet"):
        read_scan(str(tmp_path / "post.ply"), stature)
    subject = Subject(person[0].person.mass, stature, person[0].person.sex, 30.0)
    bones = measured_skeleton(person[0], subject, np.random.default_rng(8))
    scan = read_scan(str(person[1]), stature)
    slim = scan.triangles * [1.0, 1.0, 0.35]
    with pytest.raises(SessionRefused, match=r"arm cannot be told from the trunk|arm is .* long"):
        cut_scan(replace(scan, triangles=slim), bones)


def test_a_scan_of_somebody_else_is_refused_by_its_weight(person: tuple[ScannedPerson, Path]) -> None:
    scanned, path = person
    heavy = Subject(1.4 * scanned.person.mass, scanned.person.stature, scanned.person.sex, 30.0, scan=str(path))
    bones = measured_skeleton(scanned, heavy, np.random.default_rng(8))
    with pytest.raises(SessionRefused, match=r"the scan weighs .* kg by volume and density, but the body mass is"):
        prior(reference(Settings.table, heavy), bones, heavy)


def test_session_file_names_the_scan_beside_it(tmp_path: Path) -> None:
    file = tmp_path / "session.toml"
    file.write_text('[subject]\nscan = "body.obj"\nscan_up = "y"\n')
    with pytest.raises(SessionRefused, match=r"session.toml: \[subject\] scan: there is no file .*body.obj"):
        read_session_file(tmp_path)
    (tmp_path / "body.obj").write_text("")
    found = read_session_file(tmp_path).subject
    assert (found.scan, found.scan_up) == (str(tmp_path / "body.obj"), "y")
