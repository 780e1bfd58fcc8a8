# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import math
from dataclasses import replace

import numpy as np
import pytest

from soilmoist_ros.sensing.moisture.curve import CalibrationCurve, UniversalCurve
from soilmoist_ros.sensing.moisture.site import Calibration, estimate_n0, load_site, write_calibration

UNIT = CalibrationCurve(1.0, 1.4, 0.02)


CURVES = pytest.mark.parametrize("unit_curve", [UNIT, UniversalCurve(1.0, 1.4, 0.02, humidity_gm3=6.0)])


@CURVES
def test_calibration_closes(unit_curve):
    n0 = estimate_n0(4.0, 0.04, 0.22, 0.01, unit_curve).n0_cps
    assert replace(unit_curve, n0_cps=n0).vwc(4.0) == pytest.approx(0.22, abs=1e-12)


def test_a_single_core_has_no_standard_error():
    estimate = estimate_n0(4.0, 0.04, 0.2, math.nan, UNIT)
    assert estimate.n0_sd_cps == estimate.from_counting_cps > 0


@CURVES
def test_uncertainty_of_n0_is_that_of_repeated_calibrations(unit_curve):
    rng = np.random.default_rng(4)
    true = replace(unit_curve, n0_cps=6.0)
    vwc, vwc_sd, exposure = 0.22, 0.01, 3600.0
    rate = float(true.rate_cps(vwc))
    counts = rng.poisson(rate * exposure, 1000)
    moistures = rng.normal(vwc, vwc_sd, 1000)
    repeated = [
        estimate_n0(n / exposure, 0.0, m, 0.0, unit_curve).n0_cps for n, m in zip(counts, moistures, strict=True)
    ]
    estimate = estimate_n0(rate, math.sqrt(rate / exposure), vwc, vwc_sd, unit_curve)
    assert estimate.n0_cps == pytest.approx(6.0)
    assert estimate.n0_sd_cps == pytest.approx(np.std(repeated), rel=0.07)


def test_writing_keeps_comments_and_other_settings(tmp_path):
    path = tmp_path / "site.yaml"
    path.write_text(
        "# my site\nname: north field # the wet one\nsoil: {bulk_density_gcm3: 1.4}\nlongitude: west\n"
    )
    write_calibration(path, Calibration(n0_cps=6.25, n0_sd_cps=0.05, note="3 cores"))
    text = path.read_text()
    assert "# my site" in text
    assert "# the wet one" in text
    site = load_site(path)
    assert site.calibration is not None
    assert site.calibration.n0_cps == 6.25
    assert site.longitude == "west"
    assert [entry.name for entry in tmp_path.iterdir()] == ["site.yaml"]
