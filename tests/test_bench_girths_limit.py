"""What is left by a predictor that learned, and by masses that are right in the mean (benchmarks/girths_limit.py)."""

from dataclasses import replace

import numpy as np
import pytest
from generated_people import generate_person
from girths_limit import SEEN, learn, masses_of, means_known, seen


def test_the_predictor_learns_a_law_of_second_degree_and_leaves_what_is_noise():
    rng = np.random.default_rng(0)
    x = rng.normal(2.0, 3.0, (3000, 4))
    law = np.stack([x[:, 0] * x[:, 1] - x[:, 2], x[:, 3] ** 2], axis=1)
    predict = learn(x[:2000], law[:2000] + rng.normal(0, 0.1, (2000, 2)))
    assert np.std(predict(x[2000:]) - law[2000:]) < 0.02


def test_masses_right_in_the_mean_keep_how_people_differ():
    people = [generate_person(seed) for seed in range(6)]
    true = masses_of(people)
    off = np.where(np.array([one.sex for one in people]) == "M", 1.3, 0.8)[:, None, None]
    assert means_known(people, true[:, None] * off * np.ones((1, 3, 1))) == pytest.approx(
        true[:, None] * np.ones((1, 3, 1))
    )
    own = np.exp(np.array([0.1, -0.1, -0.1, 0.1, 0.0, 0.0]))[:, None, None]
    assert means_known(people, true[:, None] * own) == pytest.approx(true[:, None] * own)


def test_more_tapes_and_volumes_see_more_and_no_seer_sees_masses():
    people = [generate_person(seed) for seed in range(4)]
    width = {name: seen(people, sees).shape[1] for name, sees in SEEN.items()}
    assert [width[name] - width["no girth"] for name in SEEN] == [0, 7, 14, 42, 7]
    heavier = [replace(one, masses={name: 2 * kg for name, kg in one.masses.items()}) for one in people]
    for sees in SEEN.values():
        assert seen(heavier, sees) == pytest.approx(seen(people, sees))
