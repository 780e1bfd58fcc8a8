# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Masked arrays: their masked values are never taken for numbers."""

import numpy as np
import pytest

from soilmoist_ros.foundation.geodesy import LocalFrame
from soilmoist_ros.mapping import (
    FieldGrid,
    PoissonKriging,
    Samples,
    Variogram,
    empirical_semivariogram,
    fit_variogram,
)
from soilmoist_ros.sensing.moisture.curve import CalibrationCurve, UniversalCurve

XY = np.array([(0.0, 0.0), (10.0, 0.0), (20.0, 5.0), (40.0, 10.0), (45.0, 30.0)])
COUNTS, TIME_S = np.array([300.0, 320.0, 380.0, 500.0, 470.0]), np.full(5, 100.0)
MODEL = Variogram("exponential", 0.0, 20.0, 0.1)
USES = [
    lambda *data: Samples(*data),
    lambda *data: fit_variogram(*data, extent_m=60.0),
    lambda *data: PoissonKriging(MODEL).fit(*data),
    lambda *data: PoissonKriging(MODEL).fit(XY, COUNTS, TIME_S).add(*data),
    lambda *data: empirical_semivariogram(*data, edges=[0.0, 20.0, 60.0]),
]


@pytest.mark.parametrize("use", USES)
@pytest.mark.parametrize("masked", [0, 1, 2])
def test_masked_values_of_samples_are_refused(use, masked):
    data = [np.ma.masked_array(values) for values in (XY, COUNTS, TIME_S)]
    assert use(*data) is not None  # a mask that masks nothing is no fault
    data[masked] = np.ma.masked_array(
        data[masked], mask=np.arange(data[masked].size).reshape(data[masked].shape) == 2
    )
    with pytest.raises(ValueError, match=f"{('xy', 'counts', 'exposure_s')[masked]} has 1 masked values"):
        use(*data)


def test_masked_targets_are_refused():
    kriging = PoissonKriging(MODEL).fit(XY, COUNTS, TIME_S)
    with pytest.raises(ValueError, match="xy has 2 masked values"):
        kriging.predict(np.ma.masked_equal(XY, 10.0))
    with pytest.raises(ValueError, match="x_m must be a finite vector"):
        kriging.predict_grid(np.ma.masked_equal([0.0, 5.0], 5.0), [0.0])
    with pytest.raises(ValueError, match="all finite"):
        FieldGrid.from_track(np.ma.masked_equal(XY, 45.0), 5.0)
    with pytest.raises(ValueError, match="is not finite"):
        FieldGrid.from_polygon(np.ma.masked_equal(XY, 45.0), 5.0)
    places = LocalFrame(50.0, 10.0).to_local(np.ma.masked_array([50.0, 50.1], mask=[False, True]), [10.0, 10.0])
    assert places[0].tolist() == [0.0, 0.0]
    assert np.isnan(places[1]).all()


@pytest.mark.parametrize("curve", [CalibrationCurve(6.0, 1.4), UniversalCurve(6.0, 1.4, humidity_gm3=5.0)])
def test_a_masked_rate_has_no_moisture(curve):
    rate = np.ma.masked_array([3.0, 3.5], mask=[False, True])
    vwc, (same, sd) = curve.vwc(rate), curve.vwc_and_sd(rate, np.full(2, 0.1))
    assert vwc[0] == same[0] == pytest.approx(float(curve.vwc(3.0)))
    assert np.isnan([vwc[1], same[1], sd[1], curve.rate_cps(np.ma.masked_array([0.2], mask=True))[0]]).all()
