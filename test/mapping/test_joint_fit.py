# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The joint model (joint_fit.py, conditioning.py, pattern.py) against dense kriging of all surveys."""

from dataclasses import replace

import numpy as np
import pytest

from soilmoist_ros.mapping import joint_fit
from soilmoist_ros.mapping import joint_fit as pattern
from soilmoist_ros.mapping.covariates import Covariates
from soilmoist_ros.mapping.field_map import FieldMap, FieldMapSettings
from soilmoist_ros.mapping.grid import FieldGrid
from soilmoist_ros.mapping.joint_fit import LOADINGS, JointModel, PatternFeatures, PatternState
from soilmoist_ros.mapping.knowledge import EarlierSurvey, Knowledge
from soilmoist_ros.mapping.kriging.poisson_kriging import PoissonKriging
from soilmoist_ros.mapping.samples import Samples, Surveys
from soilmoist_ros.mapping.variogram.field_prior import FieldPrior
from soilmoist_ros.mapping.variogram.model import Variogram
from soilmoist_ros.mapping.variogram.reml import RestrictedLikelihood
from soilmoist_ros.sensing.records import CountRecord

GRID = FieldGrid.from_polygon([(0, 0), (60, 0), (60, 50), (0, 50)], cell_m=5.0)
VARIOGRAM = Variogram("matern32", nugget=0.01, range_m=12.0, sill=0.25)
NOISE = 3.0
TARGETS = np.array([(10.0, 10.0), (30.0, 25.0), (55.0, 45.0), (2.0, 48.0)])


def joint_covariance(variogram, surveys, between, noise_rate, effects=None):
    """Covariance matrix of the rates of all surveys, by the textbook: one dense matrix.

    :param between: correlation of the patterns of two surveys, shape (S, S)
    :param effects: covariates times the standard deviations of their effects, for each survey
    """
    xy, survey = _stacked(surveys)
    distance = np.linalg.norm(xy[:, None] - xy, axis=-1)
    covariance = variogram.structured_sill * variogram.correlation(distance) * between[survey][:, survey]
    if effects is not None:
        covariance += np.concatenate(effects) @ np.concatenate(effects).T
    exposure_s = np.concatenate([one.exposure_s for one in surveys])
    return covariance + np.diag(variogram.nugget + noise_rate / exposure_s)


def joint_kriging(variogram, surveys, between, noise_rate, targets, effects=None):
    """Smooth rate of the last survey at targets, and the covariance matrix of its errors.

    :param effects: of the samples of each survey, and of the targets
    """
    xy, survey = _stacked(surveys)
    matrix = joint_covariance(variogram, surveys, between, noise_rate, effects and effects[0])
    means = (survey[:, None] == np.arange(len(surveys))).astype(float)
    of_target = np.zeros((len(targets), len(surveys)))
    of_target[:, -1] = 1.0
    sill = variogram.structured_sill
    across = sill * variogram.correlation(np.linalg.norm(xy[:, None] - targets, axis=-1))
    across *= between[survey][:, [-1]]
    among = sill * variogram.correlation(np.linalg.norm(targets[:, None] - targets, axis=-1))
    if effects is not None:
        across += np.concatenate(effects[0]) @ effects[1].T
        among = among + effects[1] @ effects[1].T
    rate = np.concatenate([one.rate_cps for one in surveys])
    inverse = np.linalg.inv(matrix)
    information = means.T @ inverse @ means
    mean = np.linalg.solve(information, means.T @ inverse @ rate)
    estimate = of_target @ mean + across.T @ inverse @ (rate - means @ mean)
    open_ = of_target - across.T @ inverse @ means
    return estimate, among - across.T @ inverse @ across + open_ @ np.linalg.solve(information, open_.T)


def joint_likelihood(variogram, surveys, between, noise_rate, effects=None):
    """Restricted log-likelihood of all rates, the mean of each survey integrated out."""
    _, survey = _stacked(surveys)
    matrix = joint_covariance(variogram, surveys, between, noise_rate, effects)
    means = (survey[:, None] == np.arange(len(surveys))).astype(float)
    rate = np.concatenate([one.rate_cps for one in surveys])
    inverse = np.linalg.inv(matrix)
    information = means.T @ inverse @ means
    rest = rate - means @ np.linalg.solve(information, means.T @ inverse @ rate)
    determinants = np.linalg.slogdet(matrix)[1] + np.linalg.slogdet(information)[1]
    return float(-0.5 * (determinants + rest @ inverse @ rest + (len(rate) - len(surveys)) * np.log(2 * np.pi)))


def _stacked(surveys):
    xy = np.concatenate([one.xy for one in surveys])
    return xy, np.repeat(np.arange(len(surveys)), [len(one) for one in surveys])


def simulated(surveys, samples, rho, seed=0):
    """Samples of surveys whose patterns have the correlation rho, and the rate of the last one in the cells."""
    rng = np.random.default_rng(seed)
    xy = np.concatenate([GRID.cells, rng.uniform([0, 0], [60, 50], (surveys * samples, 2))])
    distance = np.linalg.norm(xy[:, None] - xy, axis=-1)
    factor = np.linalg.cholesky(VARIOGRAM.correlation(distance) + 1e-9 * np.eye(len(xy)))
    pattern_of_all = factor @ rng.standard_normal(len(xy))
    made = []
    for number in range(surveys):
        own = factor @ rng.standard_normal(len(xy))
        rate = 3.0 + 0.5 * (np.sqrt(rho) * pattern_of_all + np.sqrt(1 - rho) * own)
        here = len(GRID.cells) + samples * number + np.arange(samples)
        made.append(Samples(xy[here], rng.poisson(np.maximum(rate[here], 0.1) * 40.0), np.full(samples, 40.0)))
    return made, rate[: len(GRID.cells)]


def conditioned(surveys, loadings, candidates, covariates=None, effect_sd=(), share=1.0):
    """Kriging of the last survey with the prior that the joint model makes of the others, and its likelihood."""
    features = PatternFeatures.of(VARIOGRAM, candidates, covariates)
    unit = np.concatenate([np.full(features.rank, np.sqrt(VARIOGRAM.structured_sill)), effect_sd])
    state, log = PatternState.before(features.rank, len(effect_sd)), 0.0
    for number, survey in enumerate(surveys):
        view = joint_fit.view_of(survey, features, unit, NOISE)
        one = (loadings[number] == LOADINGS).astype(float)
        log += float(state.log_likelihoods(view)[one > 0][0])
        if number < len(surveys) - 1:
            state = state.after(view, one).later(share)
    prior = FieldPrior(features, state.scale(loadings[-1]) * unit, state.excess, state.mean)
    last = surveys[-1]
    kriging = PoissonKriging(VARIOGRAM, keep_nugget=False, mean_rate=NOISE, prior=prior)
    return kriging.fit(last.xy, last.counts, last.exposure_s), log


LOADED = (0.98, 0.8, 0.94)


@pytest.fixture
def exact(monkeypatch):
    """Inducing places enough to lose nothing."""
    monkeypatch.setattr(pattern, "MAX_LOST", 1e-9)
    monkeypatch.setattr(pattern, "MAX_RANK", 10_000)


def trends(xy):
    return np.column_stack([xy[:, 0] / 30 - 1, np.sin(xy[:, 1] / 9)])


@pytest.mark.usefixtures("exact")
@pytest.mark.parametrize(("share", "effect_sd"), [(1.0, ()), (0.7, ()), (1.0, (0.3, 0.1))])
def test_conditioning_on_surveys_is_dense_kriging_of_all(share, effect_sd):
    """A pattern that persists, one whose correlations fall with time, and effects of covariates."""
    surveys, _ = simulated(3, 20, 0.9)
    everywhere = np.concatenate([*(one.xy for one in surveys), TARGETS])
    apart = np.abs(np.subtract.outer(np.arange(3), np.arange(3)))
    between = np.where(apart == 0, 1.0, np.outer(LOADED, LOADED) * share**apart)
    covariates = trends if effect_sd else None
    kriging, log = conditioned(surveys, LOADED, everywhere, covariates, effect_sd, share)
    effects = [trends(xy) * effect_sd for xy in (*(one.xy for one in surveys), TARGETS)] if effect_sd else None
    split = effects and (effects[:-1], effects[-1])
    rate, covariance = joint_kriging(VARIOGRAM, surveys, between, NOISE, TARGETS, split)
    found, variance = kriging.predict(TARGETS)
    np.testing.assert_allclose(found, rate, atol=1e-6)
    np.testing.assert_allclose(variance, np.diag(covariance), atol=1e-6)
    np.testing.assert_allclose(kriging.covariance(TARGETS), covariance, atol=1e-6)
    expected = joint_likelihood(VARIOGRAM, surveys, between, NOISE, split and split[0])
    assert log == pytest.approx(expected, abs=1e-4)


def test_the_variogram_is_that_of_what_the_effects_leave():
    (samples,), _ = simulated(1, 40, 1.0)
    at = np.log([0.2, 12.0, 0.01])
    effects = np.column_stack([samples.xy[:, 0] / 30 - 1]) * 0.4
    surveys = Surveys((samples, samples), (effects, effects))
    found = RestrictedLikelihood.of_surveys(surveys, "matern32").value(at)
    rate = samples.counts.sum() / samples.exposure_s.sum()
    one = joint_likelihood(Variogram("matern32", 0.01, 12.0, 0.21), [samples], np.eye(1), rate, [effects])
    assert found == pytest.approx(2 * one, rel=1e-9)
    slope = RestrictedLikelihood.of_surveys(surveys, "matern32").expand(at)[1]
    for number, step in enumerate(1e-5 * np.eye(3)):
        likelihood = RestrictedLikelihood.of_surveys(surveys, "matern32")
        difference = (likelihood.value(at + step) - likelihood.value(at - step)) / 2e-5
        assert slope[number] == pytest.approx(difference, rel=1e-4, abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("model", ["matern32", "gaussian"])
def test_condensing_loses_at_most_half_a_percent_of_the_sill(model, monkeypatch):
    monkeypatch.setattr(f"{__name__}.VARIOGRAM", Variogram(model, 0.01, 12.0, 0.25))
    surveys, _ = simulated(4, 60, 0.9)
    loaded = np.full(4, 0.94)
    between = np.outer(loaded, loaded)
    np.fill_diagonal(between, 1.0)
    kriging, _ = conditioned(surveys, loaded, np.concatenate([one.xy for one in surveys[:-1]]))
    rate, covariance = joint_kriging(VARIOGRAM, surveys, between, NOISE, GRID.cells)
    found, variance = kriging.predict(GRID.cells)
    lost = (variance - np.diag(covariance)) / VARIOGRAM.structured_sill
    assert lost.min() > -0.002
    assert lost.max() < 0.005
    assert (np.abs(found - rate) < 0.5 * np.sqrt(np.diag(covariance))).all()


def mapped(samples, knowledge=None, **settings):
    field_map = FieldMap(GRID, FieldMapSettings(**settings), *([] if knowledge is None else [knowledge]))
    field_map.set_samples(samples)
    return field_map.update()


def test_without_knowledge_maps_stay_as_they_are():
    (samples,), _ = simulated(1, 30, 1.0)
    one, other = mapped(samples), mapped(samples, Knowledge())
    assert (one.rate[GRID.mask] == other.rate[GRID.mask]).all()
    assert (one.variance[GRID.mask] == other.variance[GRID.mask]).all()


@pytest.mark.slow
def test_a_related_survey_helps_and_an_unrelated_one_does_not_hurt():
    errors = {}
    for rho in (0.9, 0.0):
        alone, joint = [], []
        for seed in range(6):
            (before, now), truth = simulated(2, 60, rho, seed)
            few = Samples(now.xy[:15], now.counts[:15], now.exposure_s[:15])
            known = Knowledge((EarlierSurvey("may", 0.0, before),))
            alone.append(np.mean((mapped(few).rate[GRID.mask] - truth) ** 2))
            joint.append(np.mean((mapped(few, known).rate[GRID.mask] - truth) ** 2))
        errors[rho] = np.sum(joint) / np.sum(alone)
    assert errors[0.9] < 0.75
    assert errors[0.0] < 1.1


@pytest.mark.slow
def test_a_covariate_helps_and_has_an_effect_and_useless_ones_hardly_hurt():
    shape = np.random.default_rng(1).standard_normal((5, *GRID.shape))
    with_it, useless, alone, effects = [], [], [], []
    for seed in range(6):
        (now,), truth = simulated(1, 25, 1.0, seed)
        raster = np.full(GRID.shape, np.nan)
        raster[GRID.mask] = truth
        smooth = Covariates.over(GRID, ["moisture"], [raster])
        follows = mapped(now, Knowledge(covariates=smooth))
        rough = mapped(now, Knowledge(covariates=Covariates.over(GRID, list("abcde"), shape)))
        without = mapped(now)
        for errors, soil_map in ((alone, without), (with_it, follows), (useless, rough)):
            errors.append(np.mean((soil_map.rate[GRID.mask] - truth) ** 2))
        (effect,) = follows.fit.prior.effects
        effects.append(effect.mean)
        assert effect.interval[0] > 0
    assert np.sum(with_it) < 0.7 * np.sum(alone)
    assert np.sum(useless) < 1.05 * np.sum(alone)
    assert 0.2 < np.mean(effects) < 0.7


def test_on_line_covariates_that_are_left_out_change_nothing(monkeypatch):
    monkeypatch.setattr("soilmoist_ros.mapping.joint_fit.MAX_USELESS", 0.0)
    (now,), _ = simulated(1, 25, 1.0)
    layers = np.random.default_rng(1).standard_normal((5, *GRID.shape))
    known = Knowledge(covariates=Covariates.over(GRID, list("abcde"), layers))
    one, other = FieldMap(GRID), FieldMap(GRID, knowledge=known)
    for number, ((x_m, y_m), counts) in enumerate(zip(now.xy.tolist(), now.counts.tolist(), strict=True)):
        record = CountRecord(1e9 + 60.0 * number, x_m, y_m, 0.0, int(counts), 60.0, 60.0)
        for field_map in (one, other):
            field_map.add(record)
        if number % 6 == 5:
            np.testing.assert_array_equal(one.update().rate, other.update().rate)


def test_where_a_covariate_is_missing_the_map_is_less_certain():
    (now,), truth = simulated(1, 25, 1.0)
    raster = np.full(GRID.shape, np.nan)
    raster[GRID.mask] = truth
    raster[:, 7:] = np.nan
    half = mapped(now, Knowledge(covariates=Covariates.over(GRID, ["moisture"], [raster])))
    (effect,) = half.fit.prior.effects
    own = np.full(GRID.shape, np.nan)
    own[GRID.mask] = half.fit.prior.own_variance(GRID.cells)
    assert (own[:, :7] == 0).all()
    np.testing.assert_allclose(own[:, 10:], effect.mean**2 + effect.sd**2)
    # A sample shares nothing of it with the places around: the map is never more certain than that.
    assert (half.variance[:, 10:] > 0.99 * own[:, 10:]).all()


@pytest.mark.parametrize(("is_known", "factor"), [(False, 1.5), (True, 1.3)])
def test_of_very_many_samples_neighbours_are_pooled(is_known, factor, monkeypatch):
    (before, now), truth = simulated(2, 120, 0.9)
    known = Knowledge((EarlierSurvey("may", 0.0, before),)) if is_known else None
    exact = mapped(now, known)
    monkeypatch.setattr("soilmoist_ros.mapping.soil_map.MAX_EXACT_SAMPLES", 60)
    quick = mapped(now, known)
    assert len(quick.kriging.places) <= 60 < len(quick.samples) == len(exact.kriging.places)
    assert quick.pooling == f"of 120 samples in {len(quick.kriging.places)} pools"
    errors = [np.mean((one.rate[GRID.mask] - truth) ** 2) for one in (exact, quick)]
    assert errors[1] < factor * errors[0]


def surveys_of_a_season(rho, odd=None, count=5):
    made, _ = simulated(count + 1, 40, rho)
    if odd is not None:
        made[odd] = simulated(1, 40, 1.0, seed=77)[0][0]
    earlier = [EarlierSurvey(f"week {number}", 86400.0 * 7.0 * number, made[number]) for number in range(count)]
    return Knowledge(tuple(earlier)), made[-1]


@pytest.mark.slow
@pytest.mark.parametrize(("share", "fades"), [(0.98, False), (0.75, True)])
def test_days_tell_how_fast_a_pattern_fades(share, fades):
    rng = np.random.default_rng(1)
    xy = [rng.uniform([0, 0], [60, 50], (50, 2)) for _ in range(8)]
    distance = np.linalg.norm(np.concatenate(xy)[:, None] - np.concatenate(xy), axis=-1)
    factor = np.linalg.cholesky(VARIOGRAM.correlation(distance) + 1e-9 * np.eye(400))
    drawn, surveys = factor @ rng.standard_normal(400), []
    for number, here in enumerate(xy):
        drawn = share * drawn + np.sqrt(1 - share**2) * (factor @ rng.standard_normal(400))
        rate = 3.0 + 0.5 * drawn[50 * number : 50 * number + 50]
        samples = Samples(here, rng.poisson(np.maximum(rate, 0.1) * 60.0), np.full(50, 60.0))
        surveys.append(EarlierSurvey(f"{number}", 20 * 86400.0 * number, samples))
    relations = mapped(surveys.pop().samples, Knowledge(tuple(surveys))).fit.prior.relations
    model = JointModel(Knowledge(tuple(surveys)), FieldMap(GRID)._estimate, "local")
    assert np.isfinite(model._history.decay_days) == fades
    assert (relations[0].correlation < 0.5) == fades


@pytest.mark.slow
def test_model_samples_follow_the_records_and_not_the_maps():
    known, now = surveys_of_a_season(0.9, count=2)
    one, other = (FieldMap(GRID, FieldMapSettings(merge_radius_m=1.0), known) for _ in range(2))
    for number in range(25):
        x_m, y_m = now.xy[number].tolist()
        record = CountRecord(1e9 + 60.0 * number, x_m, y_m, 0.0, int(now.counts[number]), 40.0, 40.0)
        for field_map in (one, other):
            assert field_map.add(record) is None
        one.update()
    assert len(one.state.model_samples) < len(one.samples)
    np.testing.assert_array_equal(one.soil_map.rate, other.update().rate)


def test_a_planner_with_the_variogram_of_the_mapper_has_the_same_map():
    (before, now), _ = simulated(2, 30, 0.9)
    known = Knowledge((EarlierSurvey("may", 0.0, before),))
    mapper, planner = (FieldMap(GRID, FieldMapSettings(), known) for _ in range(2))
    mapper.set_samples(now)
    of_mapper = mapper.update()
    planner.set_samples(now, replace(of_mapper.fit, prior=None))  # as in the message
    of_planner = planner.update()
    np.testing.assert_array_equal(of_planner.rate, of_mapper.rate)
    np.testing.assert_array_equal(of_planner.variance, of_mapper.variance)
    assert of_planner.fit.prior.relations == of_mapper.fit.prior.relations


@pytest.mark.slow
def test_one_odd_survey_does_not_spoil_a_season():
    for odd in (0, 2):
        known, now = surveys_of_a_season(0.95, odd)
        correlations = [one.correlation for one in mapped(now, known).fit.prior.relations]
        assert correlations[odd] < 0.3
        assert min(correlations[:odd] + correlations[odd + 1 :]) > 0.4
