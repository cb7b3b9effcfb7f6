"""The shipped tables: unchanged, consistent, with provenance, and the prior made from them."""

import shutil

import numpy as np
import pytest

from biodance.body.human.human import disagreement, human, primitive_covariance, scaled_lumps
from biodance.body.human.skeleton import SEGMENTS, generic_skeleton, peak_torque
from biodance.body.parts import (
    TENSOR,
    RigidInertia,
    inertial_parameters,
    parameter_jacobian,
    rigid_inertia,
    smallest_eigenvalues,
)
from biodance.body.tables.anthropometry import COUNT, KINDS, read_segment_table, read_table
from biodance.body.tables.choice import PARTS, measured_whole, reference, regression, table_names
from biodance.errors import BiodanceError, UnknownName
from biodance.library import folder, names, read_toml
from biodance.records import Subject

FAMILIES = ("segments", "human", "robots", "uncertainty")
TABLES = [(family, name) for family in FAMILIES for name in names(f"anthropometry/{family}", ".csv")]
PEOPLE = [
    ("F", 1.50, 45.0),
    ("F", 1.75, 65.0),
    ("F", 1.62, 90.0),
    ("M", 1.60, 55.0),
    ("M", 1.77, 75.0),
    ("M", 1.95, 110.0),
]


@pytest.mark.parametrize(("family", "name"), TABLES)
def test_every_table_says_where_it_comes_from_and_is_unchanged(family: str, name: str) -> None:
    table = read_table(family, name)  # refuses a changed csv by its sha256
    assert table.rows
    for key in ("title", "source", "units", "sd", "population", "sha256"):
        assert str(table.provenance[key]).strip(), key


def test_a_changed_table_is_refused(tmp_path) -> None:
    shutil.copytree(folder("anthropometry") / "segments", tmp_path / "segments")
    path = tmp_path / "segments" / "de_leva_1996.csv"
    assert read_segment_table(path).value("head", "mass", sex="F") == 0.0668
    path.write_text(path.read_text().replace("0.0668", "0.0669"))
    with pytest.raises(BiodanceError, match="numbers were changed"):
        read_segment_table(path)


# Numbers of each table, and sums of value, regression coefficients and sd by quantity, from the files of before the
# tidy schema.
SUMS = {
    "de_leva_1996": (252, {"mass": 4.7773, "length": 12.2616, "com": 20.1507, "gyration": 39.818}),
    "dumas_2018": (220, {"mass": 1.533, "length": 4.746, "com": -5.447, "gyration": 23.91}),
    "winter_2009": (128, {"mass": 5.672, "length": 1.754, "com": 18.308, "gyration": 25.804}),
    "zatsiorsky_2002": (50, {"mass": 7.40007, "com": 0.918507, "inertia": -0.67768308}),
    "mass_studies": (213, {"mass": 19.20749}),
}


@pytest.mark.parametrize("name", SUMS)
def test_no_number_of_a_table_was_lost(name: str) -> None:
    table, (count, sums) = read_segment_table(name), SUMS[name]
    assert len(table.numbers) == count
    for quantity, expected in sums.items():
        mine = [one for key, one in table.numbers.items() if key[3] == quantity]
        assert sum(n.value + n.per_kg + n.per_m + np.nan_to_num(n.sd) for n in mine) == pytest.approx(
            expected, abs=1e-8
        ), quantity


def test_spot_values_as_printed() -> None:
    """Copied by hand: de Leva 1996 Table 4; Dumas and Wojtusch 2018 (%); Winter 2009 Table 4.1; Zatsiorsky 2002
    (stature in cm, kg cm2).
    """
    leva, dumas, winter, zats = (
        read_segment_table(n) for n in ("de_leva_1996", "dumas_2018", "winter_2009", "zatsiorsky_2002")
    )
    assert [leva.value("thigh", q, a, sex="F") for q, a in (("mass", ""), ("com", "longitudinal"))] == [0.1478, 0.3612]
    assert leva.values("thigh", "gyration", "sagittal transverse longitudinal", sex="M") == (0.329, 0.329, 0.149)
    assert dumas.values("thigh", "gyration", "xx yy zz xy xz yz", sex="M") == (0.29, 0.15, 0.30, 0.07, -0.02, -0.07)
    assert dumas.values("head_neck", "com", "x y z", sex="F") == (0.008, 0.559, -0.001)
    assert (
        winter.value("thigh", "gyration", "transverse_proximal", sex="F")
        == winter.value("thigh", "gyration", "transverse_proximal", sex="M")
        == 0.54
    )
    thigh = zats.number("thigh", "inertia", "sagittal", sex="M")
    assert (thigh.value * 1e4, thigh.per_kg * 1e4, thigh.per_m * 1e2, thigh.sd * 1e4) == pytest.approx(
        (-3557, 31.7, 18.61, 248)
    )
    assert read_segment_table("mass_studies").number("thigh", "mass", sex="F", study="pavol_2002").value == 0.11621


@pytest.mark.parametrize("sex", ["F", "M"])
def test_every_table_makes_a_person_who_can_exist(sex: str) -> None:
    subject = Subject(72.0, 1.72, sex)
    for name in table_names(sex):
        person = reference(name, subject)
        assert sum(COUNT[kind] * person.segments[kind].mass for kind in KINDS) == pytest.approx(1.0, abs=1e-12), name
        for kind in KINDS:
            assert smallest_eigenvalues(inertial_parameters(person.segments[kind]))[0] > 0, (name, kind)
            assert np.linalg.norm(person.segments[kind].com) < 1.05 * person.lengths[kind], (name, kind)


def test_every_row_of_the_shipped_tables_can_exist() -> None:
    leva, dumas = read_segment_table("de_leva_1996"), read_segment_table("dumas_2018")
    for segment, sex in {key[1:3] for key in leva.numbers}:
        squares = np.array(leva.values(segment, "gyration", "sagittal transverse longitudinal", sex=sex)) ** 2
        assert 2 * squares.max() < squares.sum(), segment
    for segment, sex in {key[1:3] for key in dumas.numbers}:
        xx, yy, zz, xy, xz, yz = (r * abs(r) for r in dumas.values(segment, "gyration", "xx yy zz xy xz yz", sex=sex))
        tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        assert np.linalg.eigvalsh(0.5 * np.trace(tensor) * np.eye(3) - tensor)[0] > 0, segment


def test_each_study_of_masses_adds_up() -> None:
    pairs = ("thigh", "shank", "foot", "upper_arm", "forearm", "hand", "shoulder")
    table = read_segment_table("mass_studies")
    for study, sex in table.groups:
        mine = [
            (1 + (key[1] in pairs)) * one.value
            for key, one in table.numbers.items()
            if (key[0], key[2]) == (study, sex)
        ]
        assert sum(mine) == pytest.approx(1.0, abs=1e-3), study


def test_zatsiorsky_masses_add_up_to_the_body_before_any_renormalisation() -> None:
    for mass, stature in ((55.0, 1.65), (75.0, 1.77), (90.0, 1.85)):
        subject = Subject(mass, stature, "M")
        total = sum(
            regression(part, "mass", "", subject)[0] * (2 if kind not in ("pelvis", "trunk_head") else 1)
            for kind in KINDS
            for part in PARTS[kind]
        )
        assert total == pytest.approx(mass, rel=0.005)


def test_strength_of_the_table_is_anderson() -> None:
    anderson = read_table("human", "anderson_2007")
    for sex, mass, stature, expected in (("M", 75.0, 1.77, 209.7), ("F", 65.0, 1.75, 202.0)):
        assert peak_torque(anderson, Subject(mass, stature, sex), "hip", "extension") == pytest.approx(
            expected, abs=0.5
        )


def test_the_covariance_is_the_spread_of_drawn_bodies() -> None:
    """The analytic Jacobian: parameters of bodies with drawn mass, CoM and inertia scatter as the covariance says."""
    lump = rigid_inertia(human(Subject(70.0, 1.72, "M")).sip.of("right_thigh"))
    step = 1e-6
    numeric = np.zeros((10, 10))
    base = inertial_parameters(lump)
    for column in range(10):
        mass, com, unit = lump.mass, np.array(lump.com), lump.inertia / lump.mass
        if column == 0:
            mass += step
        elif column < 4:
            com[column - 1] += step
        else:
            i, j = TENSOR[column - 4]
            unit = unit.copy()
            unit[i, j] += step
            unit[j, i] = unit[i, j]
        numeric[:, column] = (inertial_parameters(RigidInertia(mass, com, mass * unit)) - base) / step
    np.testing.assert_allclose(parameter_jacobian(lump), numeric, atol=1e-4)


@pytest.mark.parametrize("table", ["de_leva_1996", "dumas_2018"])
@pytest.mark.parametrize(("sex", "stature", "mass"), PEOPLE)
def test_a_person_from_a_table_weighs_the_body_mass_and_can_exist(
    table: str, sex: str, stature: float, mass: float
) -> None:
    body = human(Subject(mass, stature, sex, 30.0), table=table)
    assert body.segments == SEGMENTS
    assert body.sip.mass.sum() == pytest.approx(mass, rel=1e-9)
    assert smallest_eigenvalues(body.sip.phi).min() > 0
    assert np.all(body.sip.com >= body.com_boxes[:, 0])
    assert np.all(body.sip.com <= body.com_boxes[:, 1])


@pytest.mark.parametrize(("sex", "stature", "mass"), PEOPLE)
def test_the_covariance_is_one(sex: str, stature: float, mass: float) -> None:
    body = human(Subject(mass, stature, sex, 30.0))
    covariance = body.sip.covariance
    np.testing.assert_allclose(covariance, covariance.T)
    scale = np.sqrt(np.diag(covariance))
    assert np.linalg.eigvalsh(covariance / np.outer(scale, scale)).min() > -1e-9
    masses = np.arange(0, 120, 10)
    relative = scale[masses] / body.sip.mass
    assert np.all((relative > 0.04) & (relative < 0.35))
    total = np.sqrt(covariance[np.ix_(masses, masses)].sum())
    assert total < 0.5, "the scale pins the sum of the masses"


# Merged reference values: de Leva 1996, woman 1.75 m, 65 kg; man 1.77 m, 75 kg (kg)
REFERENCE = {
    "F": {
        "pelvis": 8.1055,
        "right_thigh": 9.607,
        "left_shank": 3.1265,
        "right_foot": 0.8385,
        "trunk_head": 23.907,
        "left_foot": 0.8385,
    },
    "M": {
        "pelvis": 8.3775,
        "right_thigh": 10.62,
        "left_shank": 3.2475,
        "right_foot": 1.0275,
        "trunk_head": 29.4225,
        "left_foot": 1.0275,
    },
}


@pytest.mark.parametrize(("sex", "stature", "mass"), [("F", 1.75, 65.0), ("M", 1.77, 75.0)])
def test_masses_of_de_leva(sex: str, stature: float, mass: float) -> None:
    body = human(Subject(mass, stature, sex, 30.0))
    for segment, expected in REFERENCE[sex].items():
        assert body.sip.of(segment)[0] == pytest.approx(expected, rel=2e-3), segment


def test_left_mirrors_right() -> None:
    body = human(Subject(70.0, 1.72, "M", 40.0))
    mirror = np.array([1, 1, 1, -1, 1, 1, 1, -1, -1, 1])
    for segment in SEGMENTS:
        if segment.startswith("right_"):
            np.testing.assert_allclose(
                body.sip.of(segment.replace("right_", "left_")), mirror * body.sip.of(segment), atol=1e-12
            )


def test_women_have_no_zatsiorsky_regressions_and_unknown_tables_are_refused() -> None:
    with pytest.raises(UnknownName, match="de_leva_1996"):
        human(Subject(70.0, 1.7, "F", 30.0), table="nobody_1900")
    with pytest.raises(BiodanceError):
        human(Subject(70.0, 1.7, "F", 30.0), table="zatsiorsky_2002")


def test_marker_sets_are_readable_toml() -> None:
    for name in names("anthropometry/marker_sets"):
        assert read_toml(folder("anthropometry") / "marker_sets" / f"{name}.toml")["source"]


@pytest.mark.parametrize("sex", ["F", "M"])
def test_what_one_limb_shows_of_the_tables_disagreement_moves_all_limbs(sex: str) -> None:
    subject = Subject(70.0, 1.72, sex)
    table, other = (human(subject, table=name).sip for name in ("de_leva_1996", "dumas_2018"))
    x = 10 * SEGMENTS.index("right_thigh") + 1
    pulled = np.array(table.covariance[:, x]) / table.covariance[x, x] * (other.phi[x] - table.phi[x])
    for segment in ("left_thigh", "right_shank", "right_foot", "left_foot"):
        cut = slice(10 * SEGMENTS.index(segment) + 1, 10 * SEGMENTS.index(segment) + 3)
        assert pulled[cut] @ (other.phi[cut] - table.phi[cut]) > 0, segment
    assert np.linalg.eigvalsh(table.covariance).min() > -1e-12


@pytest.mark.parametrize("table", ["de_leva_1996", "dumas_2018", "pavol_2002"])
def test_the_disagreement_of_tables_does_not_widen_a_limb(table: str) -> None:
    subject = Subject(70.0, 1.72, "F")
    skeleton = generic_skeleton(reference(table, subject), subject)
    lumps = scaled_lumps(reference(table, subject), skeleton, subject)
    others = tuple(
        scaled_lumps(reference(name, subject), skeleton, subject) for name in measured_whole() if name != table
    )
    alone, together = (primitive_covariance(lumps, skeleton, some) for some in ((), others))
    ways = np.sum([disagreement(lumps, other) ** 2 for other in others], axis=0)
    place = np.arange(120) % 10 > 0
    grown = np.diag(together)[place] - np.diag(alone)[place]
    assert np.all(grown <= np.maximum(0.0, ways - 0.75 * np.diag(alone))[place] + 1e-15)
    assert np.all(np.diag(together)[place] >= 0.25 * np.diag(alone)[place] - 1e-15)


def test_left_and_right_vary_as_mirror_images() -> None:
    """A point cloud and its reflection at z = 0: what makes the right number larger makes the reflected left one
    larger, all ten.
    """
    rng = np.random.default_rng(3)
    cloud, weight = rng.normal(size=(20, 3)), rng.uniform(0.1, 1.0, 20)
    other = cloud * [1.0, 1.0, -1.0]

    def ten(points: np.ndarray) -> np.ndarray:
        inertia = sum(m * (p @ p * np.eye(3) - np.outer(p, p)) for m, p in zip(weight, points, strict=True))
        return np.array([weight.sum(), *(weight @ points), *(inertia[i, j] for i, j in TENSOR)])

    signs = np.sign(ten(other) / ten(cloud))
    sip = human(Subject(70.0, 1.72, "M", 40.0)).sip
    correlation = sip.covariance / np.sqrt(np.outer(np.diag(sip.covariance), np.diag(sip.covariance)))
    for kind in ("thigh", "shank", "upper_arm"):
        right, left = (10 * SEGMENTS.index(f"{side}_{kind}") for side in ("right", "left"))
        own = np.diag(correlation[right : right + 10, left : left + 10])
        assert (signs * own > 0.3).all(), (kind, signs * own)
