# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest

from soilmoist_ros.exploration.planning.decision import Thresholds, check_thresholds, parse_thresholds
from soilmoist_ros.exploration.planning.planning_model import EVEN_SHARE, PlanningModel
from soilmoist_ros.foundation import InputError
from soilmoist_ros.mapping import PoissonKriging, Variogram
from soilmoist_ros.sensing.moisture.curve import CalibrationCurve

TWO = Thresholds((3.0, 4.0), (3.0, 4.0), (1.0, 2.0))
RATE, VARIANCE = np.array([2.0, 3.1, 3.6, 5.0]), np.array([0.1, 0.3, 0.5, 0.4])


def cost(mean, truth, thresholds=TWO):
    """Cost of choosing zones by means."""
    each = zip(thresholds.rates_cps, thresholds.prices, strict=True)
    return sum(price * np.abs(truth - at) * ((mean < at) != (truth < at)) for at, price in each)


def test_the_loss_and_what_counts_save_are_those_of_draws():
    rng, moved = np.random.default_rng(1), 0.6 * VARIANCE
    later = RATE + np.sqrt(moved) * rng.normal(size=(400_000, 4))
    truth = later + np.sqrt(VARIANCE - moved) * rng.normal(size=later.shape)
    now, then = cost(RATE, truth).mean(axis=0), cost(later, truth).mean(axis=0)
    assert TWO.loss(RATE, VARIANCE) == pytest.approx(now, abs=0.004)
    assert TWO.loss(RATE, moved) == pytest.approx(now - then, abs=0.004)
    step = 1e-6
    slope = (TWO.loss(RATE, VARIANCE + step) - TWO.loss(RATE, VARIANCE - step)) / (2 * step)
    assert TWO.marginal(RATE, VARIANCE) == pytest.approx(slope, rel=1e-5)
    zones = [np.searchsorted([3.0, 4.0], values) for values in (RATE[None], later, truth)]
    assert TWO.wrong(RATE, VARIANCE) == pytest.approx((zones[0] != zones[2]).mean(), abs=0.002)
    assert TWO.wrong(RATE, VARIANCE, moved) == pytest.approx((zones[1] != zones[2]).mean(), abs=0.01)


def test_thresholds_of_the_moisture_are_rates_with_the_price_of_the_moisture():
    curve = CalibrationCurve(n0_cps=5.0, bulk_density_gcm3=1.4)
    found = Thresholds.of((0.1, 0.3), curve)
    assert curve.vwc(np.array(found.rates_cps)) == pytest.approx([0.1, 0.3])
    assert found.prices[1] > found.prices[0] > 0, "a count/s is more moisture where it is wet"
    assert found.outside(np.full(50, found.rates_cps[0]), np.full(50, 1e-4)) == (0.3,)
    with pytest.raises(InputError, match=r"threshold 20 is not between 0 and .*write 0\.2"):
        Thresholds.of((20.0,), curve)
    with pytest.raises(InputError, match=r"0\.2 looks like a moisture, but there is no calibration .* counts/s"):
        Thresholds.of((0.2, 4.0), None)


@pytest.mark.parametrize("text", ["", "wet", "0.2 to 0.3", "-1", "0", "nan", "inf"])
def test_other_texts_are_refused(text):
    with pytest.raises(InputError, match="list of thresholds"):
        parse_thresholds(text)
    assert parse_thresholds(" 0.3;10 %;20% 0.2") == (0.1, 0.2, 0.2, 0.3)
    with pytest.raises(InputError, match="name 15 % twice"):
        check_thresholds("0.2,0.15,15%")


def test_a_model_for_a_decision_saves_loss_and_looks_at_the_threshold():
    rng, axis, exposure_s = np.random.default_rng(3), np.arange(2.0, 50.0, 4.0), np.full(20, 200.0)
    cells, xy = np.stack(np.meshgrid(axis, axis), -1).reshape(-1, 2), rng.uniform(0, 50, (20, 2))
    kriging = PoissonKriging(Variogram("matern32", 0.0, 15.0, 1.0), keep_nugget=False)
    kriging.fit(xy, rng.poisson(exposure_s * (3 + xy[:, 0] / 20)), exposure_s)
    even = np.full(len(cells), 1 / len(cells))
    plain, model = (PlanningModel(kriging, cells, even, xy, thresholds=one) for one in (None, TWO))
    before = model.integrated_variance
    assert before == pytest.approx(plain.integrated_variance)
    assert 0 < model.fall(np.array([5]), np.array([60.0])) < before
    assert model.weight.sum() == pytest.approx(1.0)
    near = np.abs(model.rate[: len(cells), None] - [3.0, 4.0]).min(axis=1)
    assert model.weight[near < 0.1].mean() > 1.3 / len(cells) > model.weight[near > 0.7].max()
    assert model.weight.min() >= EVEN_SHARE / len(cells)
    far = PlanningModel(kriging, cells, even, xy, thresholds=Thresholds((90.0,), (90.0,), (1.0,)))
    assert np.array_equal(far.weight, even), "no count will change it: the map as a whole"
    assert far.fall(np.array([5]), np.array([60.0])) == plain.fall(np.array([5]), np.array([60.0]))
