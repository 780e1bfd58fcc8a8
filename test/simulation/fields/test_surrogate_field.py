# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Files that surrogate fields write: surrogate_field.py."""

from dataclasses import replace

import numpy as np
import pytest

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.mapping import Variogram, load_field
from soilmoist_ros.sensing.moisture.site import Irrigation, load_site
from soilmoist_ros.simulation import simulated_site, surrogate_field, write_field_file, write_site_file
from soilmoist_ros.simulation.fields.surrogate_field import CORES_SD, GridExtent, RateGrid, kriged_grid

NO_GO = """
name: "Holes: 'and' \\u00e4 \\"quotes\\""
datum: {latitude_deg: 53.1234567891, longitude_deg: -0.000000123}
polygon: [[0.123456789, 0], [40, 0], [40, 1234.56789], [0, 30]]
no_go: [[[25, 20], [30, 20], [30, 26], [25, 26]]]
cell_m: 2
truth: {formula: {family: ridge, background: 2, crest: 3, angle_deg: 30}}
"""


UNIVERSAL = (
    "soil: {bulk_density_gcm3: 1.3, lattice_water: 0.02, bulk_density_sd_gcm3: 0.1}, "
    "calibration: {n0_cps: 9, n0_sd_cps: 0.2, curve: universal, parameter_set: uranos_thl}"
)


@pytest.fixture(params=["half-wet", "airfield_points", "with-holes", "universal"])
def field(request, tmp_path):
    if request.param in ("half-wet", "airfield_points"):
        return surrogate_field(request.param)
    path = tmp_path / "made.yaml"
    text = NO_GO.replace("\\u00e4", "ä")
    if request.param == "universal":
        text = text.replace("truth: {", f"truth: {{{UNIVERSAL}, ")
    path.write_text(text, encoding="utf-8")
    return surrogate_field(str(path))


def test_the_field_file_says_all_but_the_truth(field, tmp_path):
    path = tmp_path / "new" / "field.yaml"
    write_field_file(field, path)
    read = load_field(path)
    assert read.frame == field.frame
    assert read.cell_m == field.field.cell_m
    assert np.array_equal(read.polygon, field.polygon)
    for ring, other in zip(read.no_go, field.field.no_go, strict=True):
        assert np.array_equal(ring, other)
    assert read.name == f"{field.title} (simulated)"
    with pytest.raises(InputError, match="has no truth"):
        surrogate_field(str(path))


def test_the_site_file_has_a_calibration_of_one_core_day_with_its_deviation(field, tmp_path):
    write_site_file(field, tmp_path / "site.yaml")
    site, true = load_site(tmp_path / "site.yaml"), field.curve
    assert site == simulated_site(field)
    assert (site.irrigation.texture, site.irrigation.efficiency) == ("loam", 0.8)
    if true is None:
        assert site.curve is None
        return
    exact = replace(site.curve, n0_cps=true.n0_cps, n0_sd_cps=true.n0_sd_cps)
    assert exact == true  # all but N0
    assert 0 < abs(site.curve.n0_cps / true.n0_cps - 1) < 4 * CORES_SD
    assert site.curve.n0_sd_cps == pytest.approx(CORES_SD * true.n0_cps, rel=0.05)
    assert f"the true N0 is {true.n0_cps:g} counts/s" in site.calibration.note


def test_the_site_file_has_the_corrections_and_the_irrigation_keys_of_the_user(field, tmp_path):
    write_site_file(field, tmp_path / "site.yaml")
    site = load_site(tmp_path / "site.yaml")
    assert site.humidity_method == "linear"  # as the simulated weather acts
    own = Irrigation(texture="sand", root_depth_mm=500)
    write_site_file(field, tmp_path / "site.yaml", irrigation=own)
    assert load_site(tmp_path / "site.yaml").irrigation == own


def test_errors_of_simulated_core_days_are_those_that_they_state():
    field = surrogate_field("half-wet")
    known = [simulated_site(replace(field, name=str(number))).curve for number in range(400)]
    errors = np.array([(one.n0_cps - field.curve.n0_cps) / one.n0_sd_cps for one in known])
    assert np.mean(np.abs(errors) < 1.645) == pytest.approx(0.9, abs=0.05)
    assert abs(errors.mean()) < 0.15


def test_where_nothing_can_be_written_is_said(field, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be written"):
        write_field_file(field, tmp_path / "file" / "field.yaml")


SQUARE = np.array([[0.0, 0.0], [40.0, 0.0], [40.0, 30.0], [0.0, 30.0]])
EXTENT = GridExtent.of(SQUARE, 2.0)


def test_kriging_agrees_with_the_equations_solved_directly():
    rng = np.random.default_rng(4)
    xy, values = rng.uniform(0, 40, (9, 2)), rng.uniform(3, 5, 9)
    variogram = Variogram("matern32", 0.0, 12.0, 0.7)
    place = np.array([[11.0, 17.0]])
    distance = np.hypot(*(xy[:, None] - xy[None]).transpose(2, 0, 1))
    system = np.block([[variogram.covariance(distance), np.ones((9, 1))], [np.ones((1, 9)), np.zeros((1, 1))]])
    right = np.append(variogram.covariance(np.hypot(*(xy - place).T)), 1.0)
    expected = np.linalg.solve(system, right)[:9] @ values
    assert kriged_grid(xy, values, variogram, place[:, 0], place[:, 1]).values[0, 0] == pytest.approx(
        expected, rel=1e-9
    )


def test_a_nugget_is_filtered_without_spikes():
    rng = np.random.default_rng(5)
    xy, values = rng.uniform(0, 40, (30, 2)), rng.normal(4, 0.1, 30)
    variogram = Variogram("exponential", 0.01, 20.0, 0.02)
    at, near = (
        kriged_grid(xy, values, variogram, xy[:1, 0] + shift, xy[:1, 1]).values[0, 0] for shift in (0.0, 1e-6)
    )
    assert at == pytest.approx(near, abs=1e-5)
    assert abs(at - values[0]) > 1e-3


def test_an_extrapolation_below_zero_is_refused():
    xy = np.array([[0.0, 10.0], [8.0, 10.0], [10.0, 10.0], [30.0, 10.0]])
    with pytest.raises(ValueError, match=r"the extrapolated rate is -.* counts/s at x = .*overshoots"):
        kriged_grid(xy, np.array([9.0, 1.0, 0.01, 9.0]), Variogram("matern52", 0.0, 30.0, 10.0), *EXTENT.axes())


def test_interpolation_is_bilinear_and_constant_beyond_the_edge():
    grid = RateGrid(np.array([0.0, 2.0]), np.array([0.0, 4.0]), np.array([[1.0, 3.0], [5.0, 7.0]]))
    places = np.array([[0, 0], [1, 0], [1, 2], [2, 4], [-9, 0], [9, 9]], float)
    np.testing.assert_allclose(grid(places), [1, 2, 4, 7, 1, 7])
