"""All evidence of a session in one linear model: rows in newtons, metres and seconds against the whitened ones, and
tolerances that plates and observations share.
"""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from diagnosed_sessions import about_plate, body, known, nothing, windows
from inferred_sessions import SILENT, inferred
from scipy.linalg import block_diag
from scipy.stats import multivariate_normal

from biodance.diagnosis.candidates import SCALE, candidate
from biodance.diagnosis.model import causes_of
from biodance.diagnosis.problem import problem
from biodance.diagnosis.witness_evidence import ObservedEvidence
from biodance.effects import Care, NamedCause, effects
from biodance.effects.unequal_limbs import UnequalLimbs
from biodance.inference.columns import VisibleColumns
from biodance.inference.rows import BODY, rows_of
from biodance.inference.scales import bare, nominal, posterior, prior_sd
from biodance.inference.session import see
from biodance.inference.sets import Search, at_scales, hypothesis
from biodance.observations import ObservableCause, Observation
from biodance.pipeline.judged_trials import chosen_windows
from biodance.uncertainty.bands import BANDS
from biodance.uncertainty.tolerances import shipped

OFFSET = ("plate_offset", "Fx")
SIZE = 0.3
"""N, tolerance of a plate's zero in `known`."""


@dataclass(frozen=True, eq=False)
class Told(ObservedEvidence):
    """Observations that respond to causes as their ``sensitivities`` say, without a recording."""

    @property
    def counting(self) -> "Told":
        """All of them count."""
        return self

    def columns(self, effect, target, parameters):
        """Return the sensitivities."""
        none = np.zeros(len(self.observations))
        return self.sensitivities.get((effect, target), none)[:, None] * np.ones(len(parameters))


def told(*values: float, sd: float, unit: str = "N", norms: float = 0.0) -> Told:
    """Return observations of the zero of Fx, which may share an error of the size ``norms``."""
    shared = {"laboratory": norms} if norms else {}
    seen = tuple(
        Observation("empty_plate", f"at {k}", "t0", v, sd, 0.0, unit, norms=shared) for k, v in enumerate(values)
    )
    causes = {OFFSET: ObservableCause(*OFFSET, "offset", "N", 2.0)}
    return Told(seen, causes, {OFFSET: np.ones(len(seen))})


def short(hidden=nothing):
    """Return a look at three seconds of one trial."""
    (window,) = windows(3, trials=1, hidden=hidden)
    return (replace(window, use=window.motion.time < 3.0),)


def rows(evidence: ObservedEvidence = SILENT, hidden=nothing):
    """Return the rows of a short trial, and the causes asked."""
    put = problem(body(), short(hidden), chosen=("plate_offset",))
    causes = causes_of(put, known(), ("plate_offset",))
    return rows_of(put, causes, known(), evidence), causes


def test_the_evidence_is_the_density_of_the_forces_in_newtons() -> None:
    """Noise as it was learned by band, a body as the table says, and zeros and gains of plates as installed."""
    found, _ = rows()
    put = found.problem
    coloured = np.linalg.inv(known().whiteners(float(body().sip.mass.sum())))
    noise = block_diag(*(coloured[b] @ coloured[b].T for b in put.spectrum.band))
    n = found.plates
    plates = [one for name in ("plate_offset", "plate_gain") for one in effects()[name].at_all_targets(put.cases[0])]
    sizes = known().sizes
    columns = [sizes.get(f"{one.name} {one.target}", 0.0) * put.unit(one)[:n] for one in plates]
    X = np.concatenate([put.sip[:n], *columns], axis=1)
    density = multivariate_normal(np.zeros(n), noise + X @ X.T).logpdf(put.target[:n])
    inner = bare(VisibleColumns.of(found))
    value = posterior(replace(inner, markers=0 * inner.markers), prior_sd(found), nominal(found)).log_evidence
    turned = -0.5 * n * np.log(2 * np.pi) - sum(np.linalg.slogdet(coloured[b])[1] for b in put.spectrum.band)
    assert value + turned == pytest.approx(density, abs=1e-3)


def test_columns_of_one_kind_are_one_group_and_share_a_scale() -> None:
    """What observations share has none: how it errs was learned with it."""
    found, _ = rows(told(1.0, 2.0, sd=1.0, norms=0.5))
    assert found.groups[0] == BODY
    assert found.groups[-1] == Care.PLATES
    assert found.group[-1] == -1
    assert {found.group[where.start] for where, _ in found.tolerated.values()} == {found.groups.index(Care.PLATES)}
    first = found.problem.sip.shape[1]
    assert (found.group[:first] == 0).all()
    blocks = found.block[: found.plates].reshape(-1, 6)
    np.testing.assert_array_equal(blocks, 6 * found.problem.spectrum.band[:, None] + np.arange(6))
    assert found.block.max() == 6 * len(BANDS)
    assert (found.block[found.simulated :] == -1).all()


def test_plates_have_a_scale_beside_other_tolerances() -> None:
    """Who places markers with care has no better plates."""
    chosen = ("plate_offset", "plate_gain", "body_mass")
    put = problem(body(), short(nothing), chosen=chosen)
    found = rows_of(put, causes_of(put, shipped(), chosen), shipped(), SILENT)
    at = {name: found.group[where.start] for (name, _), (where, _) in found.tolerated.items()}
    of = {name: found.groups[group] for name, group in at.items() if group >= 0}
    assert {"plate_offset": Care.PLATES, "plate_gain": Care.PLATES, "body_mass": Care.OTHER}.items() <= of.items()
    plates = {name for name in effects() if name.startswith("plate_")}
    assert {name for name, one in effects().items() if one.care is Care.PLATES} == plates


def test_each_marker_has_a_scale_of_its_own_and_terms_of_plates_share_theirs(recording) -> None:
    """A real walk: the virtual session of this file shows no marker's place."""
    result, marker = recording("c3d_parser_Sydney"), "marker_misplaced"
    looked, known = chosen_windows(result.trials), shipped()
    seen = see(result.body, looked, known, effects(), None)
    found = rows_of(seen.problem, seen.causes, known, None)
    at = {names: set(found.member[where].tolist()) for names, (where, _) in found.tolerated.items()}
    own = [one for (name, _), one in at.items() if name == marker]
    assert len(own) > 15
    assert all(len(one) == 1 for one in own)
    assert set().union(*own) == set(range(len(own)))
    assert {k for (name, _), one in at.items() if name != marker for k in one} == {-1}
    assert set(found.member[found.group <= 0].tolist()) == {-1}, "what has no scale, and the body"


def test_a_spread_between_laboratories_has_no_scale() -> None:
    """A careless laboratory has no other clock than others: what was learned in one laboratory alone grows with its
    carelessness.
    """
    chosen, late = ("plate_offset", "time_delay"), ("time_delay", "")
    put = problem(body(), short(nothing), chosen=chosen)
    own = replace(known(), sizes={**known().sizes, "time_delay": 0.005})
    causes = causes_of(put, own, chosen)
    for found in (rows_of(put, causes, own, SILENT), rows_of(None, causes, own, told(1.0, 2.0, sd=1.0))):
        groups = {name: found.group[where.start] for name, (where, _) in found.tolerated.items()}
        assert groups.pop(late) == -1
        assert set(groups.values()) == {found.groups.index(Care.PLATES)}


def test_a_tolerance_is_the_same_in_plates_and_observations() -> None:
    """Its column is what one standard deviation of it adds to either."""
    found, _ = rows(told(1.0, 2.0, sd=0.5))
    (where, unit) = found.tolerated[OFFSET]
    put, r = found.problem, found.simulated
    one = effects()["plate_offset"].at("Fx", put.cases[0])
    np.testing.assert_allclose(found.X[:r, where], SIZE * found.white(put.unit(one)), atol=1e-6)
    np.testing.assert_allclose(found.X[r:, where], SIZE / 0.5 * np.ones((2, 1)))
    np.testing.assert_allclose(unit, [[SIZE]])
    np.testing.assert_allclose(found.y[r:], [2.0, 4.0])


def test_what_an_observation_says_of_a_zero_moves_the_zero_of_the_forces() -> None:
    """Forces know a zero to a tenth of a newton, as an empty plate does that reads 0.9 N: they meet between."""
    silent, _ = rows()
    heard, _ = rows(told(0.9, 0.9, sd=0.1))
    at = {}
    for name, found in (("silent", silent), ("heard", heard)):
        columns = VisibleColumns.of(found)
        fitted = posterior(bare(columns), prior_sd(found), nominal(found))
        where, unit = found.tolerated[OFFSET]
        at[name] = float((unit @ (columns.turn @ fitted.coefficients)[where])[0])
    assert at["silent"] + 0.2 < at["heard"] < 0.9


def test_a_cause_that_both_show_is_judged_by_both() -> None:
    """Inverse variances add up but for what both share: the tolerance and the slab."""
    hidden = about_plate(lambda local, session: local + 12.0 * np.eye(6)[0])
    fitted = {}
    for name, evidence in (("forces", SILENT), ("both", told(12.6, 12.4, sd=0.5))):
        found, causes = rows(evidence, hidden)
        one = next(c.effect for c in causes if c.names == OFFSET)
        search = Search.of(found, causes)
        both = hypothesis(search, (NamedCause(one, np.zeros(1), np.empty((0, 0))),))
        (cause,) = both.causes
        fitted[name] = both.whole(cause)[0], at_scales(search, both, nominal(found)).fit.last(1)[1][0, 0]
    (forces, wide), (both, narrow) = fitted["forces"], fitted["both"]
    assert narrow < wide
    assert abs(both - 12.4) < abs(forces - 12.4) or abs(both - 12.4) < 0.5
    assert both == pytest.approx(12.4, abs=0.8)


def test_a_fault_of_the_forces_is_less_probable_where_observations_speak_against_it() -> None:
    """Observations and forces carry one posterior. Where they agree, the odds stay: a zero as large within its
    tolerance would show in both as well.
    """
    hidden, every = about_plate(lambda local, session: local + 2.4 * np.eye(6)[0]), {"forces": SILENT}
    every |= {"both": told(2.5, 2.3, sd=0.5), "against": told(0.1, -0.2, sd=0.5)}
    told_by = {
        name: inferred(body(), short(hidden), tolerances=known(), effects=("plate_offset",), evidence=evidence)
        for name, evidence in every.items()
    }
    probability = {name: one.posterior.probabilities().get(OFFSET, 0.0) for name, one in told_by.items()}
    assert probability["against"] < min(probability["forces"], probability["both"]) - 0.003
    assert probability["both"] == pytest.approx(probability["forces"], abs=5e-4)


def test_errors_that_observations_share_are_columns_and_not_noise() -> None:
    """Ten steps of one person with a shared error of 2 N say no more than one: a zero known to 2 N."""
    found, _ = rows(told(*[3.0] * 10, sd=0.2, norms=2.0))
    last = found.X[found.simulated :, -1]
    np.testing.assert_allclose(last, 2.0 / 0.2)


def test_a_pressure_far_from_its_foot_tells_no_size() -> None:
    found, _ = rows(told(0.02, 0.50, sd=0.01, unit="m"))
    r = found.simulated
    np.testing.assert_allclose(found.y[r:], [2.0, 0.0])
    assert found.X[r].any()
    assert not found.X[r + 1].any()


def test_without_simulation_only_observations_judge() -> None:
    evidence = told(1.0, 2.0, sd=0.5, norms=1.0)
    found = rows_of(None, (), known(), evidence)
    assert (found.plates, found.simulated) == (0, 0)
    np.testing.assert_allclose(found.y, [2.0, 4.0])
    np.testing.assert_allclose(found.X, [[2.0], [2.0]])
    assert found.groups == ()
    assert (found.group == -1).all()


@pytest.mark.parametrize("size", [2.5, 3.5, 4.5, 6.0])
def test_a_fault_beyond_its_tolerance_does_not_hide_in_it(size: float) -> None:
    """Zeros of laboratories are 0.3 N: eight times as much and more is told, however far a tolerance may stretch."""
    hidden = about_plate(lambda local, session: local + size * np.eye(6)[0])
    one = inferred(body(), windows(3, hidden=hidden), tolerances=known(), effects=("plate_offset",))
    assert one.posterior.probabilities().get(OFFSET, 0.0) > 0.95


def test_the_difference_of_two_limbs_is_told_with_what_of_it_lies_in_the_body() -> None:
    """By the whole posterior covariance of all columns as they are: a table that errs on one side is lighter, too."""
    lighter = UnequalLimbs("left_shank")
    posed = problem(body(), short(), chosen={lighter.name: lighter})
    found = rows_of(posed, (), known(), SILENT)
    search = Search.of(found, (candidate(posed, lighter, posed.unit(lighter)),))
    one = hypothesis(search, (NamedCause(lighter, np.array([1.5, 0.1, 0.02]), np.empty((0, 0))),))
    (cause,) = one.causes
    share, at = lighter.in_body(posed.cases[0]), found.group == found.groups.index(BODY)
    assert one.whole(cause)[0] == pytest.approx(cause.theta[0] + share @ one.phi)
    scale = np.where(found.group < 0, 1.0, np.exp(one.fit.scales.groups[found.group]))
    both = np.concatenate([found.X * scale, one.Z], axis=1)
    covariance = np.linalg.inv(both.T @ (both * search.weight(one)[:, None]) + np.eye(both.shape[1]))
    row = np.zeros(both.shape[1])
    row[: at.size][at] = scale[at] * (posed.factor.T @ share)
    row[found.X.shape[1]] = SCALE * lighter.typical[0]
    told = one.whole_covariance(cause)
    assert told[0, 0] == pytest.approx(row @ covariance @ row, rel=0.02)
    assert told[0, 0] < 0.8 * cause.covariance[0, 0]
    np.testing.assert_array_equal(told[1:], cause.covariance[1:])
