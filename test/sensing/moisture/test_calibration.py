import math

import numpy as np
import pytest

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.sensing.moisture.calibration import (
    estimate_n0,
    pooled_rate,
    read_soil_cores,
    write_calibration,
)
from soilmoist_ros.sensing.moisture.curve import CalibrationCurve
from soilmoist_ros.sensing.moisture.site import Calibration, Soil, load_site

SOIL = Soil(bulk_density_gcm3=1.4, lattice_water=0.02)


def test_mean_and_standard_error_of_cores(tmp_path):
    path = tmp_path / "cores.csv"
    path.write_text("# taken 2024-05-02\nid,vwc,bulk_density_gcm3\na,0.20,1.3\nb,0.24,1.5\nc,0.22,\n")
    cores = read_soil_cores(path)
    assert cores.vwc == pytest.approx(0.22)
    assert cores.vwc_sd == pytest.approx(np.std([0.20, 0.24, 0.22], ddof=1) / math.sqrt(3))
    assert cores.bulk_density_gcm3 == pytest.approx(1.4)
    assert cores.count == 3


def test_gravimetric_cores_take_a_density_from_the_core_or_the_site(tmp_path):
    path = tmp_path / "cores.csv"
    path.write_text("gravimetric_water;weight\n0.10;1\n0.20;3\n")
    assert read_soil_cores(path, 1.5).vwc == pytest.approx(0.175 * 1.5)
    with pytest.raises(InputError, match="gravimetric water needs a bulk density"):
        read_soil_cores(path)


def test_a_single_core_has_no_standard_error(tmp_path):
    path = tmp_path / "cores.csv"
    path.write_text("vwc\n0.2\n")
    cores = read_soil_cores(path)
    assert math.isnan(cores.vwc_sd)
    estimate = estimate_n0(4.0, 0.04, cores.vwc, cores.vwc_sd, SOIL)
    assert estimate.n0_sd_cps == estimate.from_counting_cps > 0


def test_every_bad_cell_is_named(tmp_path):
    path = tmp_path / "cores.csv"
    path.write_text("vwc,weight\n20,1\nabc,1\n0.2,-1\n,1\n0.2,1\n")
    with pytest.raises(InputError) as caught:
        read_soil_cores(path)
    assert [(mistake.line, mistake.column) for mistake in caught.value.mistakes] == [
        (2, "vwc"),
        (3, "vwc"),
        (4, "weight"),
        (5, "vwc"),
    ]
    path.write_text("depth\n3\n")
    with pytest.raises(InputError, match="has no column 'vwc' or 'gravimetric_water', only: depth"):
        read_soil_cores(path)


def test_uncertainty_of_n0_is_that_of_repeated_calibrations():
    rng = np.random.default_rng(4)
    true = CalibrationCurve(6.0, SOIL.bulk_density_gcm3, SOIL.lattice_water)
    vwc, vwc_sd, exposure = 0.22, 0.01, 3600.0
    rate = float(true.rate_cps(vwc))
    counts = rng.poisson(rate * exposure, 4000)
    moistures = rng.normal(vwc, vwc_sd, 4000)
    repeated = [
        estimate_n0(n / exposure, 0.0, m, 0.0, SOIL).n0_cps for n, m in zip(counts, moistures, strict=True)
    ]
    estimate = estimate_n0(rate, math.sqrt(rate / exposure), vwc, vwc_sd, SOIL)
    assert estimate.n0_cps == pytest.approx(6.0)
    assert estimate.n0_sd_cps == pytest.approx(np.std(repeated), rel=0.05)


def test_pooled_rate_adds_counts_and_exposures():
    rate, sd = pooled_rate([90, 110], [20.0, 20.0])
    assert (rate, sd) == (5.0, pytest.approx(math.sqrt(200) / 40))
    with pytest.raises(ValueError, match="no count"):
        pooled_rate([0], [10.0])


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
