"""Protocol files: the shipped ones are sound, a wrong one is refused with a sentence that says what to write
instead.
"""

import pytest

from biodance.errors import BiodanceError, UnknownName
from biodance.library import names
from biodance.virtual_lab.movement.protocol import read_protocol

HEAD = """
name = "mine"
[postures.up]
left_leg = [60, 0, 0, 80, 0]
[postures.other]
right_leg = [60, 0, 0, 80, 0]
[postures.arms]
right_arm = [90, 0, 0, 0]
"""


@pytest.mark.parametrize("name", names("protocols"))
def test_shipped_protocols_have_a_static_trial_and_something_to_validate(name):
    protocol = read_protocol(name)
    assert protocol.name == name
    assert [t.role for t in protocol.trials].count("static") == 1
    assert {"fit", "validate"} <= {t.role for t in protocol.trials}
    assert all(2 <= t.duration <= 30 for t in protocol.trials)


def test_the_dance_uses_the_four_foot_configurations_and_keeps_squats_for_validation():
    protocol = read_protocol("dance")
    fit = [t for t in protocol.trials if t.role == "fit"]
    assert 120 <= sum(t.duration for t in fit) <= 180
    assert {t.stance for t in fit} == {"parallel", "right_forward"}
    raised = {frozenset(side for step in t.steps for side in step.to.raised) for t in fit}
    assert raised == {frozenset(), frozenset({"right"}), frozenset({"left"})}
    squats = [t for t in protocol.trials if t.role == "validate"]
    assert [t.steps[0].cycles for t in squats] == [10, 10]


def test_a_trial_returns_to_standing(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(HEAD + '[[trials]]\nname = "a"\nsteps = [{to = "arms", move = 1.0, hold = 0.5}]\n')
    trial = read_protocol(path).trials[0]
    assert trial.steps[-1].to.name == "stand"
    assert trial.duration == pytest.approx(2 * 1.0 + 1.5 + trial.steps[-1].duration)


def test_the_weight_goes_to_the_foot_that_stands(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(HEAD + '[[trials]]\nname = "a"\nsteps = [{to = "up", move = 1.0}]\n')
    posture = read_protocol(path).postures["up"]
    assert posture.raised == {"left"}
    assert posture.values["shift"] == (1.0,)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('name = "mine"\n', r"no \[\[trials\]\]"),
        (HEAD + "[[trials]]\nrole = 'fit'\n", "trial number 1 needs a name"),
        (HEAD + "[[trials]]\nname = 'a'\nrole = 'fitt'\n", "Did you mean 'fit'"),
        (HEAD + "[[trials]]\nname = 'a'\nstance = 'tandem'\n", "parallel, right_forward"),
        (HEAD + "[[trials]]\nname = 'a'\nsteps = [{to = 'arm'}]\n", "Did you mean 'arms'"),
        (HEAD + "[[trials]]\nname = 'a'\nsteps = [{to = 'arms', speed = 3}]\n", "'speed'"),
        (HEAD + "[[trials]]\nname = 'a'\nsteps = [{to = 'arms', move = 0.1}]\n", "at least 0.25 s"),
        (HEAD + "[[trials]]\nname = 'a'\nsteps = [{to = 'arms', move = 'slow'}]\n", "expected 1 finite number"),
        (HEAD + "[[trials]]\nname = 'a'\nsteps = [{to = 'arms', cycles = -1}]\n", "whole number"),
        (
            HEAD + "[[trials]]\nname = 'a'\nsteps = [{to = 'up'}, {to = 'other'}]\n",
            "without putting the other one down",
        ),
        (HEAD + "[[trials]]\nname = 'a'\nsteps = [{to = 'up', cycles = 3}]\n", "within a cycle"),
        (HEAD + "[[trials]]\nname = 'a'\nlead = 0.0\n", "lasts no time"),
        (HEAD + "[[trials]]\nname = 'a'\n[[trials]]\nname = 'a'\n", "occur twice"),
        (
            HEAD
            + "[postures.fly]\nleft_leg = [0, 0, 0, 90, 0]\nright_leg = [0, 0, 0, 90, 0]\n[[trials]]\nname = 'a'\n",
            "both feet",
        ),
        (HEAD + "[postures.b]\ndepth = 0.9\n[[trials]]\nname = 'a'\n", "depth in 0..0.6"),
        (HEAD + "[postures.b]\ntrunk = [1, 2]\n[[trials]]\nname = 'a'\n", "expected 3 finite numbers"),
        (HEAD + "[postures.b]\ntrunck = [1, 2, 3]\n[[trials]]\nname = 'a'\n", "Did you mean 'trunk'"),
        (HEAD + "[postures.b]\nbased_on = 'c'\n[[trials]]\nname = 'a'\n", "written before"),
    ],
)
def test_a_wrong_file_is_refused_with_the_remedy(tmp_path, text, said):
    path = tmp_path / "mine.toml"
    path.write_text(text)
    with pytest.raises(BiodanceError, match=said):
        read_protocol(path)


def test_an_unknown_protocol_lists_the_known_ones():
    with pytest.raises(UnknownName, match="dance"):
        read_protocol("danse")
