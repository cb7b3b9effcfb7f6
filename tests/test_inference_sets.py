"""The posterior over sets of causes: against dense Gaussian densities and the enumeration of all sets."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from inferred_rows import Drawn, covariance, log_prior, rows, search, with_target
from scipy.optimize import minimize
from scipy.stats import multivariate_normal, norm

from biodance.diagnosis.candidates import SCALE
from biodance.effects import UNLIKE, NamedCause
from biodance.inference.hypotheses import UNKNOWN, Hypothesis, Posterior
from biodance.inference.scales import FLOOR, Scales, bare, nominal, posterior, prior_sd
from biodance.inference.scales import LOUD as LOUDNESS
from biodance.inference.sets import hypothesis, infer, screen
from biodance.inference.unknown import EXCESS, OWN, P_UNKNOWN, energies, with_unknown


class Likely(Drawn):
    """A cause that is in nine sessions of ten."""

    prior = 0.9


def drawn(seed: int, sizes: dict[str, float], *, visible: float = 1.0, **kind):
    """Return rows with a cause of each of some ``sizes``, whose columns have the length ``visible``."""
    rng = np.random.default_rng(seed)
    made = rows(rng, **kind)
    columns = {name: visible / np.sqrt(len(made.y)) * rng.normal(size=(len(made.y), 1)) for name in sizes}
    added = sum(size * columns[name][:, 0] for name, size in sizes.items())
    root = np.linalg.cholesky(
        covariance(made, Scales(np.zeros(3), np.zeros(0), 0.0, np.ones(len(made.y) - made.simulated)))
    )
    return replace(with_target(made, root @ rng.normal(size=len(made.y)) + added), columns=columns)


def named(target: str, size: float = 0.0) -> NamedCause:
    """Return a cause with which a fit begins."""
    return NamedCause(Drawn(target), np.array([size]), np.empty((0, 0)))


def beside_causes(base: Hypothesis) -> np.ndarray:
    """Return the covariance (r, r) of the target under a hypothesis."""
    C, scales = covariance(base.rows, base.fit.scales), base.fit.scales
    n, r = base.rows.plates, base.rows.simulated
    sd = np.concatenate([np.full(n, np.exp(scales.noise)), np.ones(r - n), scales.weights**-0.5])
    return C + np.diag(sd**2 * (base.surety**-2 - 1)) + base.Z @ base.Z.T


@pytest.mark.parametrize("beside", [(), ("a",)])
def test_scores_are_those_of_dense_densities(beside: tuple[str, ...]) -> None:
    """Log Bayes factor, score and information of a further cause, without any and beside one, at fitted scales."""
    some = search(drawn(1, {"a": 9.0, "b": 2.0, "c": 0.0}, visible=3.0, observations=0))
    base = hypothesis(some, tuple(named(name) for name in beside))
    C, y = beside_causes(base), base.y
    zero = np.zeros(len(y))
    found = {one.effect.target: one for one in screen(some, base)}
    assert set(found) == {"a", "b", "c"} - set(beside)
    for target, one in found.items():
        Z = SCALE * some.rows.columns[target]
        s, G = some.score(base, Z)
        np.testing.assert_allclose(s, Z.T @ np.linalg.solve(C, y), rtol=1e-5)
        np.testing.assert_allclose(G, Z.T @ np.linalg.solve(C, Z), rtol=1e-5)
        ratio = multivariate_normal(zero, C + Z @ Z.T).logpdf(y) - multivariate_normal(zero, C).logpdf(y)
        assert one.gain == pytest.approx(ratio + some.prior["drawn", target], abs=1e-4)
        mean = SCALE * np.linalg.solve(np.eye(1) + G, s)
        np.testing.assert_allclose(one.start, mean, rtol=1e-4)


def test_targets_of_one_effect_share_its_prior() -> None:
    some = search(drawn(2, dict.fromkeys("abcd", 0.0)))
    each = Drawn.prior / 4
    assert dict(some.prior) == pytest.approx({("drawn", name): np.log(each / (1 - each)) for name in "abcd"})


def test_every_cause_is_unlike_its_model_in_each_band_and_channel_by_itself() -> None:
    """As noise beside the session's: of a cause of 8 times the noise, 7 % are 0.56 times the noise; none in the means
    of trials, which are sizes.
    """
    some = search(drawn(3, {"a": 8.0}, visible=9.0))
    one = hypothesis(some, (named("a", 8.0),), nominal(some.rows))
    n, block = some.rows.plates, some.rows.block
    taken = some.rows.added(Drawn("a"), one.causes[0].theta)
    root = {q: np.sqrt(np.mean(taken[block == q] ** 2)) for q in range(12)}
    for row, q in enumerate(block[:n]):
        expected = 1.0 if q < 6 else (1 + (UNLIKE * root[q]) ** 2) ** -0.5
        assert one.surety[row] == pytest.approx(expected, abs=0.03)
    assert (one.surety[n:] == 1).all()
    assert one.surety.min() < 0.95


@pytest.mark.parametrize("visible", [4.0, 50.0])
def test_the_scales_beside_a_cause_are_the_most_probable_ones_however_large_it_is(visible: float) -> None:
    """Without the cause the session is 5 or 280 times as loud: the fit begins there, and must not end on its way."""
    some = search(drawn(3, {"a": 8.0}, visible=visible, observations=0))
    one = hypothesis(some, (named("a", 8.0),))
    again = one
    for _ in range(5):
        again = hypothesis(some, again.causes, again.fit.scales)
    assert one.log_posterior == pytest.approx(again.log_posterior, abs=0.1)


def most_probable(made, causes) -> float:
    """Return the log density of the target with some causes, at the most probable scales, found by a general search
    over the dense density; ``causes`` with the size at which their models err.
    """
    n, louder = made.plates, np.zeros(len(made.y))
    for one in causes:
        added = made.columns[one.effect.target][:, 0] * one.theta[0]
        for q in range(6, 12):
            square = UNLIKE**2 * np.mean(added[made.block == q] ** 2)
            louder[made.block == q] += square
    louder[louder <= 0.05] = 0.0
    more = [SCALE * made.columns[one.effect.target] for one in causes]

    def minus(at):
        scales = Scales(at[:3], np.zeros(0), float(at[3]), np.zeros(0))
        C = covariance(made, scales, *more)
        C[:n, :n] += np.diag(louder[:n] * np.exp(2 * scales.noise))
        return -multivariate_normal(np.zeros(len(made.y)), C).logpdf(made.y) - log_prior(made, scales)

    return -minimize(minus, np.zeros(4), bounds=[(FLOOR, 2.0)] * 3 + [(0.0, 2.0)]).fun


def test_the_posterior_over_sets_is_the_enumeration_of_all_of_them(monkeypatch: pytest.MonkeyPatch) -> None:
    """Three causes of which one is there, one perhaps: eight sets, each at its own most probable scales."""
    monkeypatch.setattr(Drawn, "prior", 0.9)
    made = drawn(4, {"a": 5.0, "b": 2.0, "c": 0.0}, visible=1.2, observations=0)
    some = search(made)
    found = infer(some)
    assert found.weights.sum() == pytest.approx(1.0)
    fitted = {frozenset(c.effect.target for c in one.causes): one for one in found.hypotheses}
    prior, true = np.log(0.3 / 0.7), {}
    for names in (frozenset(few) for k in range(4) for few in combinations("abc", k)):
        one = fitted.get(names) or hypothesis(some, tuple(map(named, sorted(names))))
        true[names] = most_probable(made, one.causes) + prior * len(names)
    total = np.logaddexp.reduce(list(true.values()))
    plain = np.logaddexp.reduce([one.log_posterior for one in found.hypotheses])
    for names, value in true.items():
        share = np.exp(fitted[names].log_posterior - plain) if names in fitted else 0.0
        assert share == pytest.approx(np.exp(value - total), abs=0.01), names


def test_a_cause_is_as_probable_as_all_sets_that_hold_it() -> None:
    found = infer(search(drawn(5, {"a": 6.0, "b": 3.0, "c": 0.0}, visible=1.5)))
    for name, probability in found.probabilities().items():
        held = [name in one.names for one in found.hypotheses]
        assert probability == pytest.approx(found.weights[held].sum())


def test_a_cause_that_is_there_is_found_with_its_size() -> None:
    found = infer(search(drawn(6, {"a": 8.0, "b": 0.0, "c": 0.0}, visible=4.0)))
    assert found.probabilities()["drawn", "a"] > 0.99
    (one,) = found.best.causes
    assert one.theta[0] == pytest.approx(8.0, abs=2.5 * one.covariance[0, 0] ** 0.5)
    assert found.unknown < UNKNOWN


def test_without_cause_none_is_probable() -> None:
    """Of forty sessions without any, few name one, and none surely."""
    most = [
        max(infer(search(drawn(seed, dict.fromkeys("abc", 0.0)))).probabilities().values(), default=0.0)
        for seed in range(40)
    ]
    assert np.mean(np.array(most) > 0.5) <= 0.05
    assert max(most) < 0.85


LOUD = 5
"""Block of rows, of thirty, that is louder than the others."""


def beaten(seed: int):
    """Return rows one block of which is ten times as loud, and a cause that lies in this block alone."""
    made = drawn(seed, {"a": 0.0}, plates=900, observations=0, blocks=30)
    inside = made.block == LOUD
    column = np.where(inside, np.random.default_rng(seed).normal(size=inside.size), 0.0)[:, None]
    return replace(with_target(made, np.where(inside, 10.0, 1.0) * made.y), columns={"a": column / 2})


@pytest.mark.parametrize("seed", range(4))
def test_what_nobody_knows_in_one_band_and_channel_is_probable_there(seed: int) -> None:
    found = infer(search(beaten(seed)))
    assert found.unknown > UNKNOWN
    assert found.best.where_unknown == divmod(LOUD, 6)


@pytest.mark.parametrize("seed", range(4))
def test_causes_are_sought_where_nothing_is_louder_than_the_noise(seed: int) -> None:
    """A hundredfold square in one of thirty blocks: the noise grows until none of them stands out."""
    some = search(beaten(seed))
    found = infer(some)
    assert found.louder is not None
    (same,) = (one for one in found.louder.hypotheses if one.names == found.unexplained.names)
    assert max(energies(one)[0].max() for one in found.hypotheses if one.names == same.names) > 2.0
    assert energies(same)[0].max() < 1.2
    assert same.fit.scales.noise > 1.0


def test_the_noise_of_an_unknown_cause_makes_no_name() -> None:
    """At the noise of the session, several of ten such blocks name the cause that lies in them."""
    plain, final = [], []
    for seed in range(10):
        some = search(beaten(seed))
        base = hypothesis(some, ())
        alone = screen(some, replace(base, fit=posterior(bare(some.columns), prior_sd(some.rows), nominal(some.rows))))
        plain.append(alone[0].gain > 0)
        final.append(infer(some).probabilities().get(("drawn", "a"), 0.0))
    assert sum(plain) >= 3
    assert max(final) < 0.5


def test_the_unknown_is_the_ratio_of_densities_of_scales() -> None:
    """A third each that a block, the whole session or a group of what is no fault is larger than anywhere: log s
    ~ N(0, 1.4²) beside its usual spread; of a block of n rows it is measured to 1 / sqrt(2 n).
    """
    made = drawn(7, {"a": 0.0}, plates=12 * 30, observations=0)
    base = hypothesis(search(with_target(made, 1.3 * made.y)), ())
    square, count = energies(base)
    assert (count == 30).sum() == 12
    left = base.left[: base.rows.plates] * np.exp(-base.fit.scales.noise)
    np.testing.assert_allclose(square[LOUD], np.mean(left[base.rows.block[: len(left)] == LOUD] ** 2))

    def ratio(away: np.ndarray, usual: np.ndarray) -> float:
        away = np.maximum(away, 0.0)
        wide = norm(0.0, np.hypot(EXCESS, usual)).logpdf(away) - norm(0.0, usual).logpdf(away)
        return float(np.log(np.mean(np.exp(wide))))

    blocks = ratio(0.5 * np.log(square[count > 0]), np.full(12, np.sqrt(OWN**2 + 0.5 / 30)))
    session = ratio(np.array([base.fit.scales.noise]), np.array([LOUDNESS]))
    groups = ratio(base.fit.scales.groups, prior_sd(base.rows))
    odds = [np.log(p / (1 - p)) for p in P_UNKNOWN]
    expected = base.log_posterior + np.logaddexp.reduce(np.add([blocks, session, groups], odds))
    assert with_unknown(base).log_unknown == pytest.approx(expected)


def test_one_outlier_does_not_hide_or_make_a_cause() -> None:
    """A cause that plates and observations show: a single observation 30 deviations off changes neither size nor
    probability; the same in rows without cause names none.
    """
    for size in (8.0, 0.0):
        made = drawn(8, {"a": size, "b": 0.0}, visible=4.0)
        off = np.array(made.y)
        off[-1] += 30.0
        clean, odd = (infer(search(with_target(made, y))) for y in (made.y, off))
        names = ("drawn", "a")
        assert odd.probabilities().get(names, 0.0) == pytest.approx(clean.probabilities().get(names, 0.0), abs=0.1)
        if size:
            theta = [one.best.causes[0].theta[0] for one in (clean, odd)]
            assert theta[0] == pytest.approx(theta[1], abs=1.0)


def test_what_cannot_be_is_impossible(monkeypatch: pytest.MonkeyPatch) -> None:
    made = drawn(9, {"a": 8.0}, visible=4.0)
    monkeypatch.setattr(type(made), "possible", lambda self, effect, theta: theta[0] < 0)
    found = infer(search(made))
    assert found.probabilities().get(("drawn", "a"), 0.0) == 0.0
    assert isinstance(found, Posterior)
