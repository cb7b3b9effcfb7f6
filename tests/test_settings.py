"""Settings: legal values only, one key one meaning, and every one of them reaches what it is said to change."""

import tomllib
from dataclasses import fields, replace

import numpy as np
import pytest

import biodance
from biodance.cli import run
from biodance.cli.shared import DONE, NOT_DONE
from biodance.errors import BiodanceError, SessionRefused, UnknownName
from biodance.lab.markers.upright import is_still, movement, standing_mass
from biodance.lab.prepare import LowPass, force_filter, low_pass, motion_filter, prepare
from biodance.lab.session.file import read_session_file
from biodance.motion.contact import ground_contact
from biodance.motion.soles import soles_from_body
from biodance.pipeline.identification import trial_checks
from biodance.pipeline.saved_results import provenance
from biodance.pipeline.session import followed
from biodance.settings import USUAL, ContactRules, Settings, assignments
from biodance.virtual_lab.simulate import simulate_session

OTHER = {
    "table": "dumas_2018",
    "hip": "davis",
    "joints": "static",
    "filter.kind": "critically_damped",
    "filter.cutoff": 6.0,
    "filter.force_cutoff": 20.0,
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return a simulated visit."""
    return simulate_session(
        biodance.Subject(62.0, 1.70, "F", 31.0), "short", tmp_path_factory.mktemp("lab") / "visit", seed=1
    )


@pytest.fixture(scope="module")
def squat(folder):
    """Return its squat as read."""
    return biodance.read_session(folder)["squat_1"]


def short(folder, **changes):
    """Return the static trial and the squat, followed with some settings changed: nobody asks for masses here."""
    session = biodance.read_session(folder, settings={key.replace("__", "."): value for key, value in changes.items()})
    trials = (replace(session["squat_1"], role="fit"), session["static"])
    return followed(replace(session, trials=trials))


@pytest.fixture(scope="module")
def usual(folder):
    return short(folder)


def other(row):
    """Return another legal value of a setting."""
    if row.key in OTHER:
        return OTHER[row.key]
    return row.value + 1 if isinstance(row.value, int) else 1.005 * row.value


def test_what_is_printed_is_what_may_be_written():
    assert Settings().changed(tomllib.loads(Settings().to_toml())["settings"]) == USUAL
    changed = Settings().changed({row.key: other(row) for row in USUAL.all()})
    assert USUAL.changed(tomllib.loads(changed.to_toml())["settings"]) == changed
    assert all(before.value != after.value for before, after in zip(USUAL.all(), changed.all(), strict=True))
    assert all(row.meaning and row.legal for row in USUAL.all())


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"filter.cutof": 6}, "'filter.cutof' is not a setting. Did you mean 'filter.cutoff'?"),
        ({"filter": 6}, "'filter' is not a setting"),
        ({"filter.cutoff": "six"}, r"filter.cutoff = 'six' is not legal .* Legal: \"auto\", or 1 to 100 Hz"),
        ({"filter.cutoff": 600}, 'Legal: "auto", or 1 to 100 Hz'),
        ({"filter.cutoff": float("nan")}, 'Legal: "auto", or 1 to 100 Hz'),
        ({"filter.cutoff": True}, 'Legal: "auto", or 1 to 100 Hz'),
        ({"filter.order": 2.5}, "Legal: 1 to 10, a whole number"),
        ({"filter.force_cutoff": "other"}, 'Legal: "same", or 1 to 500 Hz'),
        ({"hip": "bell"}, 'Legal: "harrington", "davis"'),
        ({"table": ""}, "Legal: a name, or the path of a file"),
        ({"gravity": 0}, "Legal: 9.7 to 9.9 m/s²"),
    ],
)
def test_what_is_not_legal_is_refused_with_what_is(changes, words):
    with pytest.raises(BiodanceError, match=words):
        USUAL.changed(changes)


def test_a_record_made_by_hand_is_checked_too():
    with pytest.raises(BiodanceError, match=r"gravity = 981.* Legal: 9.7 to 9.9"):
        Settings(gravity=981)
    assert Settings(gravity=9.81).gravity == 9.81


def test_assignments_are_numbers_where_they_are():
    assert assignments(["filter.cutoff = 6", "table='dumas_2018'"]) == {"filter.cutoff": 6.0, "table": "dumas_2018"}
    with pytest.raises(BiodanceError, match=r"--set filter.cutoff: is no assignment"):
        assignments(["filter.cutoff"])


def test_session_toml_is_followed_and_the_inner_file_wins(tmp_path):
    inner = tmp_path / "visit"
    inner.mkdir()
    (tmp_path / "subject.toml").write_text("[settings]\ngravity = 9.81\nfilter.cutoff = 8\n")
    (inner / "session.toml").write_text("[settings.filter]\ncutoff = 6\n")
    found = read_session_file(inner).settings
    assert found == USUAL.changed({"gravity": 9.81, "filter.cutoff": 6})
    (inner / "session.toml").write_text("[settings]\nfilter.cutof = 6\n")
    with pytest.raises(SessionRefused, match=r"session.toml: \[settings\] 'filter.cutof' is not a setting"):
        read_session_file(inner)


def test_what_is_asked_for_goes_over_session_toml_and_a_record_replaces_it(folder):
    path = folder / "session.toml"
    text = path.read_text()
    path.write_text(text + "\n[settings]\ngravity = 9.81\nfilter.cutoff = 8\n")
    try:
        session = biodance.read_session(folder, settings={"filter.cutoff": 6})
        assert session.settings == USUAL.changed({"gravity": 9.81, "filter.cutoff": 6})
        assert all(trial.settings == session.settings for trial in session)
        assert biodance.read_session(folder, settings=USUAL).settings == USUAL
    finally:
        path.write_text(text)


def test_trials_of_different_settings_are_no_session(folder):
    session = biodance.read_session(folder)
    with pytest.raises(BiodanceError, match="different settings"):
        replace(session, trials=(session["static"], replace(session["squat_1"], settings=Settings(gravity=9.81))))


@pytest.mark.parametrize("key", [row.key for row in USUAL.all()])
def test_every_setting_stands_in_the_provenance(key, usual):
    row = next(row for row in USUAL.all() if row.key == key)
    settings = USUAL.changed({key: other(row)})
    again = replace(
        usual, session=replace(usual.session, trials=tuple(replace(t, settings=settings) for t in usual.session))
    )
    before, after = (provenance(one, created="now")["settings"] for one in (usual, again))
    assert {name for name in before if before[name] != after[name]} == {key}
    assert set(before) == {row.key for row in USUAL.all()}


def moved(before, after):
    """Return how far the simulated wrench of the squat is another one, N."""
    return float(np.abs(before["squat_1"].comparison.simulated - after["squat_1"].comparison.simulated).max())


@pytest.mark.parametrize(
    ("changes", "least"),
    [
        ({"filter__cutoff": 4.0}, 1.0),
        ({"filter__order": 2}, 0.1),
        ({"filter__kind": "critically_damped"}, 0.1),
        ({"table": "dumas_2018"}, 1.0),
        ({"hip": "davis"}, 0.05),
    ],
)
def test_a_choice_changes_the_simulated_wrench(changes, least, usual, folder):
    assert moved(usual, short(folder, **changes)) > least


def test_joints_are_static_where_that_was_chosen(folder):
    found = [followed(biodance.read_session(folder, settings={"joints": how})) for how in ("functional", "static")]
    assert [bool(one.body.joint_errors) for one in found] == [True, False]
    assert moved(*found) > 0.5


def test_gravity_reaches_weight_and_mass_alike(usual, folder):
    heavy = short(folder, gravity=9.9)
    ratio = 9.9 / 9.80665
    assert heavy.body.model.gravity.linear[2] == -9.9
    for name in ("static", "squat_1"):
        before, after = (one[name].comparison.simulated[:, 2].mean() for one in (usual, heavy))
        assert after / before == pytest.approx(ratio, rel=1e-4)
    assert usual.standing.mass / heavy.standing.mass == pytest.approx(ratio, rel=1e-9)
    assert standing_mass(usual.session["static"]) / standing_mass(heavy.session["static"]) == pytest.approx(
        ratio, rel=1e-9
    )


def test_forces_may_have_a_cutoff_of_their_own(squat):
    alone = USUAL.changed({"filter.cutoff": 6, "filter.force_cutoff": 20})
    assert (motion_filter(alone).cutoff, force_filter(alone).cutoff) == (6.0, 20.0)
    assert force_filter(USUAL.changed({"filter.cutoff": 6})).cutoff == 6.0
    plate = squat.plates[0]
    wave = np.sin(2 * np.pi * 12.0 * plate.wrench.time)[:, None] * np.ones(6)
    shaken = replace(squat, plates=(replace(plate, wrench=replace(plate.wrench, value=wave)),))
    passed = [
        prepare(replace(shaken, settings=one)).wrench.value[100:-100].std()
        for one in (alone, USUAL.changed({"filter.cutoff": 6}))
    ]
    assert passed[0] == pytest.approx(np.sqrt(0.5), rel=0.01)
    assert passed[1] < 0.05


@pytest.mark.parametrize("order", [1, 2, 5])
def test_a_critically_damped_filter_is_3_db_down_at_its_cutoff_and_never_overshoots(order):
    rate, chosen = 1000.0, LowPass(order, 10.0, "critically_damped")
    time = np.arange(20000) / rate
    out = low_pass(np.sin(2 * np.pi * 10.0 * time), rate, chosen)[5000:15000]
    assert np.sqrt(2) * out.std() == pytest.approx(np.sqrt(0.5), rel=1e-3)
    step = low_pass((time > 10).astype(float), rate, chosen)
    assert -1e-9 < step.min() <= step.max() < 1 + 1e-9
    assert low_pass((time > 10).astype(float), rate, LowPass(5, 10.0)).max() > 1.01


def test_gaps_standing_contact_and_checks_reach_their_steps(squat, usual):
    hidden = np.array(squat.markers.xyz)
    hidden[100:115, squat.markers.names.index("LANK")] = np.nan
    gappy = replace(squat, markers=replace(squat.markers, xyz=hidden))
    said = [" ".join(prepare(replace(gappy, settings=USUAL.changed({"gaps.bridged": s}))).history) for s in (0.2, 0.1)]
    assert "bridged by a spline (1): LANK" in said[0]
    assert "bridged by a spline" not in said[1]
    calm = replace(squat, markers=replace(squat.markers, xyz=0.05 * squat.markers.xyz))
    far = movement(calm.markers)
    assert is_still(replace(calm, settings=USUAL.changed({"standing.still": 1.1 * far})))
    assert not is_still(replace(calm, settings=USUAL.changed({"standing.still": 0.9 * far})))
    static = usual.session["static"]
    assert standing_mass(replace(static, settings=USUAL.changed({"standing.shortest": 30}))) is None
    strict = replace(
        usual["squat_1"], trial=replace(usual["squat_1"].trial, settings=USUAL.changed({"checks.marker_rms": 0.001}))
    )
    inside = {check.what: check.inside for check in trial_checks(strict, 62.0)}
    assert not inside["marker distance, RMS"]
    assert all(check.inside for check in usual["squat_1"].checks)


def test_every_rule_of_contact_is_asked_for_where_contact_is_found(usual):
    asked = set()

    class Watched(ContactRules):
        def __getattribute__(self, name):
            asked.add(name)
            return super().__getattribute__(name)

    one = usual["squat_1"]
    trial = replace(one.trial, settings=replace(USUAL, contact=Watched()))
    asked.clear()
    ground_contact(trial, soles_from_body(usual.body, one.motion), mass=62.0)
    assert {field.name for field in fields(ContactRules)} <= asked


def test_an_outlier_is_what_the_analyst_says(usual):
    from biodance.identification.statistics import believable
    from biodance.pipeline.trial import trial_fit

    strict = replace(usual["squat_1"], trial=replace(usual["squat_1"].trial, settings=USUAL.changed({"outlier": 0.05})))
    counts = [believable(usual.body, trial_fit(one), np.zeros(3))[0].use.sum() for one in (usual["squat_1"], strict)]
    assert counts[0] > counts[1]


def test_an_unknown_table_is_refused_before_the_work(folder):
    session = biodance.read_session(folder, settings={"table": "dumas"})
    with pytest.raises(UnknownName, match=r"'dumas' is not a table .* Did you mean 'dumas_2018'"):
        biodance.examine(session)


def test_the_command_prints_what_holds(capsys, folder):
    assert run(["settings", "--set", "filter.cutoff=6"]) == DONE
    assert USUAL.changed(tomllib.loads(capsys.readouterr().out)["settings"]).filter.cutoff == 6.0
    assert run(["settings", str(folder), "--set", "filter.cutof=6"]) == NOT_DONE
    assert "Did you mean 'filter.cutoff'?" in capsys.readouterr().err
    assert run(["settings", str(folder), "--set", "filter.cutoff=0"]) == NOT_DONE
    assert 'Legal: "auto", or 1 to 100 Hz' in capsys.readouterr().err
