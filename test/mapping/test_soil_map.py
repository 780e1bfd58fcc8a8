# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import sys

import numpy as np
import pytest

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.mapping import FieldGrid, Samples, Variogram, make_soil_map
from soilmoist_ros.mapping.variogram.fit import estimate_variogram
from soilmoist_ros.sensing.moisture.curve import CalibrationCurve

FIELD = FieldGrid.from_polygon([[0, 0], [60, 0], [60, 50], [20, 50]], 2.0)
MODEL = Variogram("matern32", 0.01, 20.0, 0.3)
CURVE = CalibrationCurve(n0_cps=6.0, bulk_density_gcm3=1.4)


def survey(n=25):
    rng = np.random.default_rng(2)
    xy = rng.uniform(0, 60, (n, 2))
    return Samples(xy, rng.poisson(600 * (4 + np.sin(xy[:, 0] / 15))), np.full(n, 600.0))


def test_bands_are_consistent_and_nan_outside():
    done = []
    soil_map = make_soil_map(survey(), FIELD, MODEL, CURVE, progress=done.append)
    for band in soil_map.bands:
        assert band.shape == FIELD.shape
        assert np.isfinite(band[FIELD.mask]).all()
        assert np.isnan(band[~FIELD.mask]).all()
    rate, rate_sd, vwc, vwc_sd, _, _ = (band[FIELD.mask] for band in soil_map.bands)
    np.testing.assert_allclose(CURVE.rate_cps(vwc), rate)
    np.testing.assert_allclose(vwc_sd, CURVE.vwc_sd(rate, rate_sd, order=3))
    assert rate_sd.min() > 0
    assert soil_map.mean_rate == pytest.approx(survey().mean_rate_cps)
    assert soil_map.undefined_vwc_cells == 0
    assert soil_map.clipped_variances == 0
    assert soil_map.variogram == MODEL
    assert soil_map.fit is None
    assert done[-1] == 1.0


def test_evaluate_at_the_cells_is_the_map():
    soil_map = make_soil_map(survey(), FIELD, MODEL, CURVE)
    for at_points, band in zip(soil_map.evaluate(FIELD.cells), soil_map.bands, strict=True):
        np.testing.assert_allclose(FIELD.to_raster(at_points), band, rtol=1e-11)


def test_without_a_curve_there_is_no_moisture():
    soil_map = make_soil_map(survey(), FIELD, MODEL)
    assert soil_map.curve is None
    assert np.isnan(soil_map.vwc).all()
    assert np.isnan(soil_map.vwc_sd).all()
    assert np.isfinite(soil_map.rate[FIELD.mask]).all()
    assert soil_map.undefined_vwc_cells == 0


def test_cells_too_wet_for_the_curve_are_counted():
    curve = CalibrationCurve(n0_cps=4.0 / 0.372, bulk_density_gcm3=1.4)  # diverges at 4 counts/s
    soil_map = make_soil_map(survey(), FIELD, MODEL, curve)
    low = soil_map.rate[FIELD.mask] <= curve.lowest_rate_cps
    assert 0 < soil_map.undefined_vwc_cells == low.sum() < low.size
    np.testing.assert_array_equal(soil_map.vwc[FIELD.mask][low], soil_map.limits.saturation)
    assert soil_map.beyond_limits[FIELD.mask][low].all()
    assert not soil_map.beyond_limits[~FIELD.mask].any()
    assert not make_soil_map(survey(), FIELD, MODEL).beyond_limits.any()


def test_a_fit_is_kept_with_the_map():
    samples = survey()
    fit = estimate_variogram(samples.xy, samples.counts, samples.exposure_s)
    soil_map = make_soil_map(samples, FIELD, fit)
    assert soil_map.fit is fit
    assert soil_map.variogram is fit.variogram


def test_filtering_the_nugget_lowers_the_uncertainty():
    keep, smooth = (make_soil_map(survey(), FIELD, MODEL, keep_nugget=keep) for keep in (True, False))
    np.testing.assert_allclose(keep.rate_sd**2 - smooth.rate_sd**2, np.where(FIELD.mask, 0.01, np.nan), rtol=1e-9)


def test_samples_may_lie_outside_the_field():
    outside = Samples([[-500, -500], [900, 20]], [1200, 2400], [600, 600])
    soil_map = make_soil_map(outside, FIELD, MODEL)
    np.testing.assert_allclose(soil_map.rate[FIELD.mask], 3.0, rtol=1e-6)


def test_no_samples_make_no_map():
    with pytest.raises(ValueError, match="at least one sample"):
        make_soil_map(Samples([], [], []), FIELD, MODEL)


def test_cells_as_a_table_and_bands_over_their_axes():
    pytest.importorskip("pandas")
    soil_map = make_soil_map(survey(), FIELD, MODEL, CURVE)
    table = soil_map.to_dataframe()
    assert list(table) == ["x_m", "y_m", "rate", "rate_sd", "vwc", "vwc_sd", "vwc_p05", "vwc_p95"]
    np.testing.assert_array_equal(table[["x_m", "y_m"]], FIELD.cells)
    np.testing.assert_array_equal(table["vwc"], soil_map.vwc[FIELD.mask])
    pytest.importorskip("xarray")
    dataset = soil_map.to_xarray()
    assert dataset.rate.dims == ("y", "x")
    assert dataset.vwc_sd.attrs["units"] == "m3/m3"
    x_m, y_m = FIELD.cells[7]
    assert dataset.rate.sel(x=x_m, y=y_m) == pytest.approx(soil_map.evaluate([(x_m, y_m)]).rate[0])
    np.testing.assert_array_equal(dataset.vwc, soil_map.vwc)


@pytest.mark.parametrize(("module", "method"), [("pandas", "to_dataframe"), ("xarray", "to_xarray")])
def test_without_the_extra_it_says_how_to_install_it(monkeypatch, module, method):
    monkeypatch.setitem(sys.modules, module, None)
    soil_map = make_soil_map(survey(), FIELD, MODEL)
    with pytest.raises(InputError, match=rf"{module} is not installed -> pip install 'soilmoist_ros\[frames\]'"):
        getattr(soil_map, method)()


def test_a_map_shows_itself_in_a_line():
    assert repr(make_soil_map(survey(), FIELD, MODEL)).startswith("SoilMap(")
    assert "\n" not in repr(FIELD)
