# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Soil cores and their mean: cores.py and core_mean.py."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from crnpy import crnpy
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.sensing.moisture.combined import (
    DAY_SD,
    GENERAL_SD,
    N0Source,
    combine_n0,
    difference_sd,
    earlier_source,
)
from soilmoist_ros.sensing.moisture.cores import SoilCore, read_soil_cores
from soilmoist_ros.sensing.moisture.footprint import Footprint, mean_of_cores
from soilmoist_ros.sensing.moisture.site import Site, UncertaintyPart


@pytest.fixture
def table(tmp_path):
    def of(text, density=None):
        path = tmp_path / "cores.csv"
        path.write_text(text)
        return read_soil_cores(path, density)

    return of


@pytest.fixture
def read(table):
    return lambda *given: table(*given).cores


def test_mean_and_standard_error_of_cores(read):
    cores = mean_of_cores(read("# taken 2024-05-02\nid,vwc,bulk_density_gcm3\na,0.20,1.3\nb,0.24,1.5\nc,0.22,\n"))
    assert cores.vwc == pytest.approx(0.22)
    assert cores.vwc_sd == pytest.approx(np.std([0.20, 0.24, 0.22], ddof=1) / math.sqrt(3))
    assert cores.bulk_density_gcm3 == pytest.approx(1.4)
    assert (cores.count, cores.profiles) == (3, 3)
    assert math.isnan(cores.depth_cm)


def test_gravimetric_cores_take_a_density_from_the_core_or_the_site(read):
    (core,) = read("Profile_ID,SoilMoisture_g_g,DryBulkDensity_g_cm3\nneptoon,0.2,1.3\n")
    assert (core.profile, core.vwc) == ("neptoon", pytest.approx(0.26))
    text = "gravimetric_water;note\n0.10;1\n0.20;3\n"
    assert mean_of_cores(read(text, 1.5)).vwc == pytest.approx(0.15 * 1.5)
    with pytest.raises(InputError, match="gravimetric water needs a bulk density"):
        read(text)


def test_the_revised_mean_agrees_with_an_independent_implementation():
    rng = np.random.default_rng(3)
    distances_m, depths_cm = np.array([1.0, 8.0, 40.0, 90.0, 250.0]), np.array([2.5, 7.5, 15.0, 25.0])
    profile, depth = (grid.ravel() for grid in np.meshgrid(np.arange(5), depths_cm, indexing="ij"))
    vwc = rng.uniform(0.08, 0.35, len(depth))
    cores = [
        SoilCore(value, 1.4, str(name), distances_m[name], at, at)
        for value, name, at in zip(vwc, profile, depth, strict=True)
    ]
    around = Footprint(0.2, humidity_gm3=7.0, pressure_hpa=960.0, vegetation_m=0.5)
    theirs, _ = crnpy.nrad_weight(
        7.0, vwc, distances_m[profile], depth, profile, rhob=1.4, p=960.0, Hveg=0.5, tol=1e-11
    )
    assert mean_of_cores(cores, "revised", around).vwc == pytest.approx(theirs, abs=1e-8)


def test_the_revised_mean_of_real_cores_agrees_with_an_independent_implementation():
    cores = read_soil_cores(Path(__file__).parents[3] / "examples" / "station_kansas_cores.csv").cores
    middles = [(core.top_cm + core.bottom_cm) / 2 for core in cores]
    points = [replace(core, top_cm=at, bottom_cm=at) for core, at in zip(cores, middles, strict=True)]
    vwc, distance_m = (np.array([getattr(core, name) for core in cores]) for name in ("vwc", "distance_m"))
    profiles = np.array([core.profile for core in cores])
    density = mean_of_cores(cores).bulk_density_gcm3
    theirs, _ = crnpy.nrad_weight(
        9.0, vwc, distance_m, np.array(middles), profiles, rhob=density, p=958.0, tol=1e-11
    )
    around = Footprint(0.2, humidity_gm3=9.0, pressure_hpa=958.0)
    assert mean_of_cores(points, "revised", around).vwc == pytest.approx(theirs, abs=1e-8)
    assert theirs == pytest.approx(0.273, abs=5e-4)
    assert mean_of_cores(cores, "revised", around).vwc == pytest.approx(0.296, abs=5e-4)  # whole layers


def test_a_thick_core_weighs_as_its_slices_and_the_thickness_does_not_change_its_place():
    slices = [
        SoilCore(0.30 if at < 10 else 0.10, 1.4, "a", 3.0, at - 0.05, at + 0.05) for at in np.arange(0.05, 30, 0.1)
    ]
    layers = [SoilCore(0.30, 1.4, "a", 3.0, 0.0, 10.0), SoilCore(0.10, 1.4, "a", 3.0, 10.0, 30.0)]
    assert mean_of_cores(layers).vwc == pytest.approx(mean_of_cores(slices).vwc, abs=1e-6)


@settings(max_examples=15)
@given(
    st.lists(st.tuples(st.floats(0, 0.6), st.floats(0, 300), st.floats(0, 60)), min_size=1, max_size=8),
    st.sampled_from(["revised", "equal"]),
    st.sampled_from([math.inf, 10.0]),
)
def test_the_mean_lies_between_the_cores(rows, weighting, radius_m):
    cores = [SoilCore(vwc, 1.3, str(n), at, depth, depth) for n, (vwc, at, depth) in enumerate(rows)]
    around = Footprint(0.2, shield_radius_m=radius_m)
    mean = mean_of_cores(cores, weighting, around).vwc
    moistures = [vwc for vwc, *_ in rows]
    assert min(moistures) - 1e-9 <= mean <= max(moistures) + 1e-9


@pytest.mark.parametrize(
    ("text", "where", "message"),
    [
        ("vwc,distance_m\n0.2,5\n0.2,\n", (3, ""), "only 1 of 2 cores have a distance"),
        ("vwc,depth_cm\n0.2,5\n0.2,\n", (3, ""), "only 1 of 2 cores have a depth"),
        ("vwc,profile,distance_m\n0.2,a,5\n0.2,a,50\n", (0, ""), "profile a have different distances"),
        ("vwc,top_cm\n0.2,5\n", (2, "top_cm"), "needs one depth"),
        ("vwc,top_cm,bottom_cm\n0.2,5,5\n", (2, "bottom_cm"), "not below the top"),
        ("vwc,depth_cm,top_cm,bottom_cm\n0.2,2.5,,\n0.2,,0,5\n", (0, ""), "some cores have a thickness"),
        ("vwc,distance_m\n0.2,900\n", (2, "distance_m"), "outside 0 to 600"),
        ("vwc_percent\n0.28\n0.31\n", (0, "vwc_percent"), "more than 0.0031 m3/m3 of water -> .* column vwc"),
        ("gravimetric_percent,bulk_density_gcm3\n0.2,1.4\n", (0, "gravimetric_percent"), "gravimetric_water if"),
        ("vwc,bulk_density_kgm3\n0.2,1.4\n", (2, "bulk_density_kgm3"), "1.4 is 0.0014 in the unit of bulk_"),
        ("vwc_percent\n28x\n", (2, "vwc_percent"), "'28x' is not a number"),
        ("vwc,top_mm,bottom_mm\n0.2,0,10\n0.2,10,30\n", (0, ""), "deeper than 3 cm: is this the right unit"),
        ("profile,vwc,distance_m\na,0.2,5\nmean,0.2,\n", (3, ""), "leave out rows that are no cores"),
    ],
)  # fmt: skip
def test_cores_that_cannot_be_weighed_or_have_another_unit_are_named(read, text, where, message):
    with pytest.raises(InputError, match=message) as caught:
        read(text)
    assert [(mistake.line, mistake.column) for mistake in caught.value.mistakes] == [where]


NOT_USED = "gravimetric_water is not used for {} cores: they have vwc"


def test_lines_of_a_spreadsheet_before_the_header_are_no_header(read):
    cores = read("sep=;\n# of May\n\nprofile;depth_cm;vwc_percent\na;5;28 %\n\na;15;31,5%\n")
    assert [core.vwc for core in cores] == pytest.approx([0.28, 0.315])


@pytest.mark.parametrize(
    ("text", "note"),
    [
        ("gravimetric_water\n0.2\n", "1 of 1 cores have no bulk density: 1.4 g/cm3 of the site file counts"),
        ("vwc,weight\n0.2,148\n0.2,152\n", "columns that are not used: weight"),
        ("vwc,gravimetric_water,bulk_density_gcm3\n0.28,0.2,1.4\n0.10,0.19,1.4\n", NOT_USED.format(2)),
        ("vwc,vwc_note,soil_moisture\n0.2,x,21\n", "columns that are not used: vwc_note, soil_moisture"),
        ("vwc,gravimetric_water\n0.2,-99\n0.2,n/a\n", NOT_USED.format(1)),
        ("vwc,organic_carbon\n0.2,1.5\n",
         "columns that are not used: organic_carbon\n"
         "lattice and organic water come from 'soil' in the site file, not from organic_carbon"),
    ],
)  # fmt: skip
def test_what_decides_the_moisture_is_said(table, text, note):
    assert table(text, 1.4 if text.startswith("grav") else None).notes == tuple(note.split("\n"))


# N0 of several sources: weights, common errors, what must not be counted twice (combined.py) ---------------------


SDS = st.floats(0.002, 0.3)
RATES = st.floats(0.2, 5.0)


@settings(max_examples=40)
@given(st.lists(st.tuples(RATES, SDS, st.floats(0, 1)), min_size=1, max_size=4))
def test_the_combination_is_never_less_sure_than_the_best_source_and_its_shares_add_up(found):
    common = 0.9 * min(sd for _, sd, _ in found)  # one common error
    sources = [N0Source("one", n0, sd, common * (share > 0.5)) for n0, sd, share in found]
    both = combine_n0(sources)
    assert both.sd <= min(source.sd for source in sources) * (1 + 1e-9)
    assert math.hypot(*both.shares) == pytest.approx(both.sd)
    assert sum(both.weights) == pytest.approx(1)
    levels = [source.n0_cps for source in sources]
    assert min(levels) * (1 - 1e-9) <= both.n0_cps <= max(levels) * (1 + 1e-9)


def test_simulated_sites_lie_within_the_stated_error():
    rng = np.random.default_rng(5)
    errors = []
    for _ in range(500):
        here, there = GENERAL_SD * rng.standard_normal(2)  # log N0 of the sites; the general one is 0
        general = N0Source(
            "general", math.exp(0.03 * rng.standard_normal()), math.hypot(0.03, GENERAL_SD), GENERAL_SD
        )
        elsewhere = math.exp(there + 0.01 * rng.standard_normal())
        before = N0Source("earlier", elsewhere, math.hypot(0.01, GENERAL_SD, GENERAL_SD), GENERAL_SD)
        cores = N0Source("cores", math.exp(here + 0.04 * rng.standard_normal()), 0.04)
        both = combine_n0([cores, general, before])
        errors.append((math.log(both.n0_cps) - here) / both.sd)
    assert np.std(errors) == pytest.approx(1, abs=0.08)


def test_many_good_cores_are_the_result():
    cores = N0Source("cores", 1.1, 0.004)
    both = combine_n0([cores, N0Source("general", 1.0, 0.06, 0.055)])
    assert abs(math.log(both.n0_cps / cores.n0_cps)) < 0.5 * cores.sd
    assert both.weights[0] > 0.99
    assert difference_sd(cores, N0Source("", 1.0, 0.06)) == pytest.approx(1.585, abs=0.01)


HERE = {"latitude_deg": 52.0, "longitude_deg": 13.0, "altitude_m": 50}
FILE = Path("before.yaml")


def site(n0_cps=1.0, place=HERE, **calibration):
    return Site(location=place, calibration={"n0_cps": n0_cps, **calibration})


def test_of_a_combined_calibration_before_only_its_cores_count():
    cores = UncertaintyPart(name="cores", value=1.2, unit="counts/s", sd=0.06, origin="measured", share=0.03)
    both = earlier_source(site(n0_sd_cps=0.02, method="combined", parts=[cores]), FILE, site(), [], None)
    assert (both.n0_cps, both.sd) == (1.2, pytest.approx(math.hypot(0.05, DAY_SD)))


@pytest.mark.parametrize(
    ("before", "message"),
    [
        (Site(location=HERE), "has no calibration"),
        (site(illustrative=True), "or a guess"),
        (site(n0_sd_cps=0.1, method="general"), "counted already"),
        (site(n0_sd_cps=0.1, method="combined"), "counted already"),
        (site(n0_sd_cps=0.1, curve="universal"), "of the curve universal"),
        (site(), "no n0_sd_cps"),
        (site(n0_sd_cps=0.1, place=None), "not known whether it is the same site"),
        (site(n0_sd_cps=0.1, date="2025-04-01, 2026-05-01"), "count twice"),
    ],
)
def test_what_cannot_be_combined_is_named(before, message):
    with pytest.raises(InputError, match=message):
        earlier_source(before, FILE, site(), ["2026-05-01"], lambda: 1.0)
