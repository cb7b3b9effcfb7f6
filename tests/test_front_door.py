"""The front door: few names, quick, the same for people, editors and type checkers; a visit diagnosed in five lines."""

import ast
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import biodance
from biodance.body.body import body_text
from biodance.lab.plates.faults import PlateCorrection
from biodance.pipeline.export import body_of_result
from biodance.pipeline.saved_results import BODY_FILE, blas, keep_motions, kept_trials, read_kept
from biodance.report.files import write_files
from biodance.version import NO_COMMIT, commit

DOOR = Path(biodance.__file__)


def test_a_person_and_a_type_checker_see_the_same_names():
    tree = ast.parse(DOOR.read_text())
    typed = {}
    for node in ast.walk(
        next(n for n in tree.body if isinstance(n, ast.If) and getattr(n.test, "id", "") == "TYPE_CHECKING")
    ):
        if isinstance(node, ast.ImportFrom):
            typed |= {alias.asname: node.module for alias in node.names}
    said = {name: f"biodance.{module}" for module, names in biodance.HOMES.items() for name in names}
    assert typed == said
    assert sorted(said) == biodance.__all__
    assert set(biodance.__all__) <= set(dir(biodance))
    assert 30 <= len(biodance.__all__) <= 50


@pytest.mark.parametrize("name", biodance.__all__)
def test_every_name_is_there(name):
    assert biodance.front_door(name).__name__ == name
    assert callable(getattr(biodance, name))


def test_a_wrong_name_lists_the_right_ones():
    with pytest.raises(AttributeError, match=r"has no attribute 'read_sesion'. It has BiodanceError, Body"):
        biodance.read_sesion  # noqa: B018


def test_it_loads_nothing_heavy():
    heavy = "{'numpy', 'scipy', 'pandas', 'matplotlib', 'numba', 'pinocchio', 'cvxpy', 'trimesh', 'pyvista', 'ezc3d'}"
    code = f"import sys, biodance; print(sorted({heavy} & set(sys.modules)))"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.strip()
    assert said == "[]"


@pytest.mark.parametrize(
    "first", ["import biodance", "import biodance.identification.identification, biodance.inference.session"]
)
def test_a_verb_stays_a_verb_whatever_was_imported_before(first):
    code = (
        f"{first}\nimport biodance\nfrom biodance import diagnose, identify\nimport biodance.identification.sessions "
        f"as sessions\n"
        "assert callable(biodance.identify) and callable(biodance.diagnose) and callable(identify) and "
        "callable(diagnose)\n"
        "try:\n    biodance.identify('nowhere')\nexcept biodance.BiodanceError as error:\n    print(error)"
    )
    done = subprocess.run([sys.executable, "-W", "error", "-c", code], capture_output=True, text=True, check=False)
    assert done.stdout.strip() == "nowhere: there is no such folder. Check the path.", done.stderr


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return a simulated visit in which Fz reads 6 % too much."""
    subject = biodance.Subject(62.0, 1.70, "F", 31.0)
    effects = ["plate_gain:target=Fz,gain=0.06"]
    return biodance.simulate(subject, "short", tmp_path_factory.mktemp("lab") / "visit", seed=2, effects=effects)


@pytest.fixture(scope="module")
def result(folder):
    return biodance.examine(biodance.read_session(folder))


@pytest.fixture(scope="module")
def identified(result):
    """Return what the visit says of the body; three tests ask for it."""
    return biodance.identify(result)


def test_a_visit_is_diagnosed_in_five_lines_and_one_import(folder):
    lines = [
        "import biodance",
        f"found = biodance.diagnose({str(folder)!r})",
        "table = found.table()",
    ]
    names: dict[str, object] = {}
    exec("\n".join(lines), names)
    found, table = names["found"], names["table"]
    assert repr(found).startswith("SessionDiagnosis(named, ")
    (row,) = [row for _, row in table.iterrows() if row["effect"] == "plate_gain"]
    assert row["target"] == "Fz"
    assert row["low"] < 0.06 < row["high"]
    assert "plate_gain" in found._repr_html_()


def test_only_the_effects_asked_for_are_looked_for(result):
    assert [f.effect for f in biodance.diagnose(result, effects=["plate_gain"]).findings] == ["plate_gain"]
    with pytest.raises(biodance.UnknownName, match=r"'plate_gian' is not an? effect"):
        biodance.diagnose(result, effects=["plate_gian"])


def test_two_visits_are_compared_and_an_earlier_one_is_a_reference(result, identified):
    first = identified
    compared = biodance.compare_sessions(first, result)  # which identifies the second one itself
    assert len(compared.table()) == 12 * 10
    assert compared.table()["difference"].abs().max() < 1e-6
    again = biodance.identify(result, reference=first)
    assert again.search.reference.startswith("session visit")
    assert len(again.changes) == 120
    assert not first.changes
    assert repr(compared) == "SessionComparison('visit' -> 'visit': no certain change)"


def test_records_show_themselves_in_one_line_and_as_html(result, identified):
    session, found = result.session, identified
    squat = result["squat_1"]
    shown = [
        session,
        session["squat_1"],
        session["squat_1"].markers,
        squat.trial.wrench,
        squat.trial.plates[0],
        squat.motion,
    ]
    shown += [squat, result, result.body, result.body.sip, found, found.identification]
    for record in shown:
        assert "\n" not in repr(record), repr(record)
        assert len(repr(record)) < 160, repr(record)
        assert repr(record).startswith(type(record).__name__ + "(")
        assert record._repr_html_().startswith("<p><b>")


def test_tables_are_in_the_units_their_columns_say(result, identified):
    import numpy as np

    motion, body = result["squat_1"].motion, result.body
    knee = motion.table()["left_knee_flexion (deg)"].to_numpy()
    np.testing.assert_allclose(np.radians(knee), motion.q[:, 7 + body.joint_index("left_knee_flexion")])
    assert 40 < knee.max() < 150
    segments = body.table()
    assert segments["mass (kg)"].sum() == pytest.approx(body.sip.mass.sum())
    assert segments.loc["pelvis", "com y (m)"] == body.sip.com[0, 1]
    wrench = result["squat_1"].trial.wrench
    np.testing.assert_array_equal(wrench.table()["Mz (N·m)"], wrench.moment[:, 2])
    found = identified.identification
    row = found.table().loc["trunk_head"]
    assert row["identified (kg)"] == pytest.approx(found.sip.of("trunk_head")[0])
    assert row["low (kg)"] < row["identified (kg)"] < row["high (kg)"]
    with pytest.raises(biodance.UnknownName, match="'weight' is not a quantity"):
        found.table("weight")


def test_a_visit_is_exported_as_it_is_in_memory(result, tmp_path):
    path, said = biodance.export(result, tmp_path / "body.urdf", format="urdf")
    assert path.read_text().startswith("<?xml")
    assert said == "Session visit: inertial parameters identified from dance_1."
    path, _ = biodance.export(result, tmp_path / "squat.mot", format="mot", trial="squat_1")
    assert "endheader" in path.read_text()
    with pytest.raises(biodance.UnknownName, match="Did you mean 'squat_1'"):
        biodance.export(result, tmp_path / "no.mot", format="mot", trial="squat1")
    place, said = biodance.export(result, tmp_path / "bids", format="bids", trial="squat_1")
    assert {one.name.split("_")[1] for one in place.rglob("*_motion.tsv")} == {"task-squat1"}
    place, _ = biodance.export(result, tmp_path / "all", format="bids")
    assert {one.name.split("_")[1] for one in place.rglob("*_motion.tsv")} >= {"task-dance1", "task-squat1"}
    with pytest.raises(biodance.BiodanceError, match="--trial: a file of format osim holds one body"):
        biodance.export(result, tmp_path / "no.osim", format="osim", trial="squat_1")


def test_a_results_folder_gives_the_forces_that_its_body_was_found_with(folder, tmp_path):
    gain = PlateCorrection("plate_gain", "Fz", 0.06, 0.003, "session visit")
    corrected = biodance.examine(biodance.read_session(folder), corrections=(gain,))
    write_files(tmp_path, {BODY_FILE: body_text(*body_of_result(corrected))})
    keep_motions(corrected, tmp_path)
    kept = read_kept(tmp_path)
    _, (again,) = kept_trials(kept, ("squat_1",))
    np.testing.assert_array_equal(again.trial.wrench.value, corrected["squat_1"].trial.wrench.value)
    plain = biodance.read_session(folder)["squat_1"].wrench.force[:, 2].mean()
    assert again.trial.wrench.force[:, 2].mean() == pytest.approx(plain / 1.06, rel=0.01)
    with pytest.raises(biodance.BiodanceError, match=r"plates were corrected when the results were made \(a lab.toml"):
        kept_trials(replace(kept, corrections=()), ("squat_1",))


@pytest.mark.skipif(shutil.which("git") is None, reason="there is no git here")
def test_the_commit_is_that_of_the_checkout_and_unknown_in_a_wheel(tmp_path):
    git = ["git", "-c", "user.name=a", "-c", "user.email=a@b"]
    package = tmp_path / "biodance"
    package.mkdir()
    (package / "a.py").write_text("1")
    assert commit(package) == NO_COMMIT
    for words in (["init", "-q"], ["add", "."], ["commit", "-qm", "one"]):
        subprocess.run([*git, *words], cwd=tmp_path, check=True)
    commit.cache_clear()
    found = commit(package)
    assert len(found) == 40
    (package / "a.py").write_text("2")
    commit.cache_clear()
    assert commit(package) == f"{found}+changed"
    commit.cache_clear()


def test_the_blas_is_named_with_its_kernel():
    from threadpoolctl import threadpool_info

    kernels = {one["architecture"] for one in threadpool_info() if one["user_api"] == "blas" and "architecture" in one}
    assert "openblas" in blas() or "mkl" in blas() or "blas" in blas()
    assert all(kernel in blas() for kernel in kernels)
