# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``soilmoist calibrate`` with core tables of other people's form: the right N0, or a question."""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from soilmoist_ros.cli.main import main
from soilmoist_ros.sensing import DAY_SD, GENERAL_SD, SurveyAir, general_calibration, load_site

DRY = [(1, 0.2), (25, 0.18), (75, 0.17), (200, 0.18)]
SITE = "location: {latitude_deg: 51.5, longitude_deg: -1.5, altitude_m: 190}\nfootprint_radius_m: 200\n"
SOIL = "soil: {bulk_density_gcm3: 1.1, lattice_water: 0.03, organic_carbon: 0.04}\n"


@pytest.fixture
def calibrate(tmp_path):
    def run(table, *options, site=SITE + SOIL, counts=1500, encoding="utf-8"):
        (tmp_path / "cores.csv").write_bytes(table.encode(encoding))
        (tmp_path / "site.yaml").write_text(site)
        arguments = ["calibrate", tmp_path / "cores.csv", "--site", tmp_path / "site.yaml", "--json"]
        arguments += ["--counts", counts, "--exposure", 3600, *options]
        result = CliRunner().invoke(main, [str(argument) for argument in arguments])
        assert result.exception is None or isinstance(result.exception, SystemExit)
        answer = json.loads(result.stdout)
        assert (answer["exit_code"] == 0) != bool(answer["errors"])
        return answer

    return run


def two_days(distance="distance_m", depth="depth_cm", days=("2015-07-04 12:00", "2016-02-08 12:00")):
    rows = [f"date,profile,{distance},{depth},gravimetric_water,bulk_density_gcm3"]
    for day, wetter in zip(days, (0.0, 0.28), strict=False):
        for number, (at_m, water) in enumerate(DRY):
            core = f"{day},{day[:4]}_{number},{at_m},{{}},{water + wetter:.3f},1.1"
            rows += [core.format(cm) for cm in (2.5, 12.5, 22.5)]
    return "\n".join(rows) + "\n"


def test_one_of_several_days_is_chosen_and_none_is_averaged_in_silence(calibrate, tmp_path):
    (error,) = calibrate(two_days())["errors"]
    assert error["message"] == "has cores of 2 days: 2015-07-04 (12 cores), 2016-02-08 (12 cores)"
    assert "--date 2015-07-04" in error["remedy"]
    alone = calibrate(two_days(days=["2015-07-04 12:00"]))
    chosen = calibrate(two_days(), "--date", "2015-07-04")
    assert chosen["n0_cps"] == alone["n0_cps"] == pytest.approx(0.718, abs=0.002)
    assert chosen["days"] == ["2015-07-04"]
    assert load_site(tmp_path / "site.yaml").calibration.date == "2015-07-04"
    assert calibrate(two_days(), "--date", "4.7.2015")["n0_cps"] == alone["n0_cps"]
    both = calibrate(two_days(), "--date", "2015-07-04", "--date", "2016-02-08")
    assert both["cores"] == 24
    assert both["n0_cps"] > alone["n0_cps"] + 0.05
    assert "has no core of 2015-07-05" in calibrate(two_days(), "--date", "2015-07-05")["errors"][0]["message"]


@pytest.mark.parametrize(
    ("name", "days", "named"),
    [
        ("Datum", ("17.01.2014 12:00", "5.2.2014"), ["2014-01-17", "2014-02-05"]),
        ("Datum", ("1/17/2014", "2/5/2014"), ["1/17/2014", "2/5/2014"]),
        ("Datum", ("22-Oct", "23-Oct"), ["22-Oct", "23-Oct"]),
        ("Zeitpunkt", ("04.07.15 9:30", "8.2.2016"), ["2015-07-04", "2016-02-08"]),
        ("Sampling Date", ("2015-07-04", "2016-02-08"), ["2015-07-04", "2016-02-08"]),
    ],
)
def test_days_in_other_notations(calibrate, name, days, named):
    (error,) = calibrate(two_days(days=days).replace("date,", f"{name},", 1))["errors"]
    assert all(f"{day} (12 cores)" in error["message"] for day in named)
    assert calibrate(two_days(days=days), "--date", days[1])["days"] == [named[1]]


def test_columns_that_are_not_used_are_named_and_no_weights_are_claimed(calibrate, tmp_path):
    answer = calibrate(two_days("distance", "depth", ["2015-07-04"]))
    used, weights = answer["warnings"]
    assert used.endswith("not used: distance, depth")
    assert "the revised weights need distance_m" in weights
    assert answer["weights"] == "equal weights"
    assert "revised" not in load_site(tmp_path / "site.yaml").calibration.note
    assert (
        calibrate(two_days(depth="depth", days=["2015-07-04"]))["weights"]
        == "revised weights of the distance alone"
    )
    assert calibrate(two_days(days=["2015-07-04"]))["weights"] == "revised weights"


def test_peat_has_more_water_than_three_times_its_dry_mass(calibrate):
    mineral = [(0.2, 0.9), (0.11, 1.2), (0.09, 1.38), (0.08, 1.4), (0.08, 1.45), (0.07, 1.5)]
    peat = [(0.25, 1.1), (1.1, 0.55), (2.4, 0.25), (3.4, 0.23), (4.0, 0.18), (4.4, 0.17)]
    rows = [
        f"P{number},{distance_m},{5 * layer},{5 * layer + 5},{water},{density}"
        for number, distance_m in enumerate([25, 25, 75, 75, 200, 200])
        for layer, (water, density) in enumerate(peat if distance_m == 200 else mineral)
    ]
    table = "\n".join(["profile,distance_m,top_cm,bottom_cm,gravimetric_water,bulk_density_gcm3", *rows])
    answer = calibrate(table, site=SITE + "soil: {bulk_density_gcm3: 1.1}\n", counts=700)
    assert answer["vwc"] == pytest.approx(0.179, abs=0.002)
    assert answer["n0_cps"] == pytest.approx(0.2934, abs=0.001)
    error = calibrate(table.replace("3.4,0.23", "34,0.23"))["errors"][0]
    assert error["message"] == "34 g/g and 0.23 g/cm3 give 7.82 m3 of water per m3"


@pytest.mark.slow
def test_moss_peat_has_less_than_a_tenth_of_the_density_of_soil(calibrate):
    answer = calibrate("gravimetric_water,bulk_density_gcm3\n9.0,0.06\n10.0,0.05\n", site=SITE)
    assert answer["vwc"] == pytest.approx(0.52)


COMMAS = """\
profile;distance_m;top_cm;bottom_cm;gravimetric_water;bulk_density_gcm3
A1;25;5;10;0,271;1,31
A1;25;10;15;0,247;1,36
A2;75;5;10;0,349;1,28
"""


@pytest.mark.parametrize(
    "table",
    [
        COMMAS,
        COMMAS.replace(",", ".").replace(";", ","),
        COMMAS.replace(";", "\t"),
        COMMAS.replace("gravimetric_water", "gravimetric_percent")
        .replace("0,271", "27,1").replace("0,247", "24,7").replace("0,349", "34,9"),
        COMMAS.replace("top_cm;bottom_cm", "depth_cm").replace("5;10;0", "5-10;0").replace("10;15", "10 – 15 cm"),
        COMMAS.replace("top_cm;bottom_cm", "top_m;bottom_m").replace("10;15;0", "0,10;0,15;0")
        .replace("5;10;0", "0,05;0,10;0"),
    ],
    ids=["commas", "points", "tabs", "per cent", "intervals", "metres"],
)  # fmt: skip
@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_notations_of_spreadsheets_mean_the_same(calibrate, table, encoding):
    answer = calibrate(table, site=SITE.replace("190", "100"), encoding=encoding)
    assert answer["vwc"] == pytest.approx(0.379, abs=0.002)
    assert answer["n0_cps"] == pytest.approx(0.728, abs=0.002)
    assert any("decimal comma" in text for text in answer.get("warnings", [])) == (",31" in table)


@pytest.mark.parametrize(
    ("table", "message", "remedy"),
    [
        (COMMAS.replace("1,36", "1.36"), "has a comma in 0,271 and a point in 1.36", "decimal point"),
        (COMMAS.replace(";", ","), "has 8 values for 6 columns", "semicolons"),
        (COMMAS.replace("0,271", "27,1 %"), "'27,1 %' is not a number", "no unit"),
        (COMMAS.replace("0,271", "-9999"), "-9999 looks like a mark of a missing value", "leave the cell empty"),
        (COMMAS.replace("10;15;", "100;150;").replace(";5;10;", ";50;100;"), "150 is outside 0 to 120", "depth"),
        (COMMAS.replace("top_cm;bottom_cm", "depth_cm;x").replace("25;5", "25;10-May"), "'10-May'", "interval"),
        (COMMAS.replace(";bulk_density_gcm3", ";top_cm"), "has 2 columns of top_cm", "keep one"),
        (COMMAS.replace("\nA1", "\n;m;mm;cm;g/g;-\nA1", 1), "'m' is not a number", "no unit"),
        (COMMAS.replace("profile", "site;profile").replace("\nA", "\nN;A", 2).replace("\nA2", "\nS;A2"),
         "has cores of several sites: N, S", "file of its own"),
        (COMMAS.replace("profile", "vwc").replace("gravimetric_water", "vwc_percent"), "columns of vwc", "keep"),
        ("PK\x03\x04", "is a spreadsheet or an archive, not text", "CSV"),
        ("depth,theta_v\n5,0.2\n", "has no column 'vwc'", "known are: vwc, gravimetric_water"),
    ],
)  # fmt: skip
def test_what_a_table_leaves_open_is_asked(calibrate, table, message, remedy):
    errors = calibrate(table)["errors"]
    assert any(message in error["message"] and remedy in error["remedy"] for error in errors), errors


def test_doubts_about_the_result(calibrate):
    answer = calibrate("vwc\n0.2\n0.25\n", site=SITE + SOIL + "calibration: {n0_cps: 2500}\n")
    assert any("N0 was 2500 counts/s in the site file" in text for text in answer["warnings"])
    answer = calibrate("vwc,bulk_density_gcm3\n0.2,1.5\n0.62,1.5\n", counts=400_000)
    for text in ("unusual", "1.50 g/cm3, the site file 1.1", "line 3: 0.62"):
        assert any(text in warning for warning in answer["warnings"]), answer["warnings"]


@pytest.mark.slow
def test_counts_of_another_day_than_the_cores_are_refused(tmp_path):
    from virtual_survey import write_survey

    write_survey(tmp_path, seed=2, spacing_m=30.0, dwell_s=60.0)
    common = [
        "calibrate", tmp_path / "cores.csv", "--site", tmp_path / "site.yaml", "--log", tmp_path / "survey.log",
    ]  # fmt: skip
    for day in ("1999-05-01", "05/01/1999"):
        (tmp_path / "cores.csv").write_text(f"date,vwc\n{day},0.2\n{day},0.22\n")
        result = CliRunner().invoke(main, [str(each) for each in [*common, "--dry-run"]])
        assert result.exit_code == 2
        assert f"the cores are of {day}, and the counts of 20" in result.output


# -- With the general calibration, earlier ones, and a station ---------------------------------------------------

SENSOR = "sensor_sensitivity: 1.0\n"


def cores_of(vwc, profiles=14):
    rows = (f"p{number},{5 + 5 * number},0,20,{vwc + 0.01 * (number % 3 - 1)}" for number in range(profiles))
    return "\n".join(["profile,distance_m,top_cm,bottom_cm,vwc", *rows])


def test_without_a_radius_cores_have_the_weights_of_a_bare_probe(calibrate):
    table = "\n".join(["profile,distance_m,top_cm,bottom_cm,vwc", *(f"p{r},{r},0,20,{v}" for r, v in DRY)])
    place = SITE.partition("footprint")[0]
    bare, shielded, wide = (
        calibrate(table, "--cores-only", site=place + radius + SOIL)["n0_cps"]
        for radius in ("", "footprint_radius_m: 10\n", "footprint_radius_m: 500\n")
    )
    assert bare == wide  # a shield beyond the reach of the neutrons changes nothing
    assert bare != pytest.approx(shielded, rel=1e-3)


def test_without_a_sensitivity_the_result_is_that_of_the_cores(calibrate, tmp_path):
    alone = calibrate(cores_of(0.25))
    written = (tmp_path / "site.yaml").read_text()
    assert calibrate(cores_of(0.25), "--cores-only") == alone
    assert (tmp_path / "site.yaml").read_text() == written
    known = calibrate(cores_of(0.25), "--cores-only", site=SITE + SOIL + SENSOR)
    assert known["n0_cps"] == alone["n0_cps"]
    assert "method" not in alone


def test_many_cores_outweigh_the_general_calibration_and_one_does_not(calibrate, tmp_path):
    site = SITE + SOIL + SENSOR
    alone = calibrate(cores_of(0.25), counts=1800)
    both = calibrate(cores_of(0.25), site=site, counts=1800)
    assert abs(both["n0_cps"] - alone["n0_cps"]) < 2 * alone["n0_sd_cps"]
    assert both["weight_of_cores"] > 0.75
    saved = load_site(tmp_path / "site.yaml").calibration
    assert saved.method == "combined"
    assert saved.n0_cps == pytest.approx(both["n0_cps"])
    shares = [part.share for part in saved.parts if part.share == part.share]
    assert sum(share**2 for share in shares) ** 0.5 == pytest.approx(saved.n0_sd_cps / saved.n0_cps, rel=1e-3)
    one = calibrate(cores_of(0.25, 1), site=site, counts=1800)
    assert any("assumption" in text for text in one["warnings"])
    parts = {part.name: part.source for part in load_site(tmp_path / "site.yaml").calibration.parts}
    assert parts["cores"] == "measured, ± assumed"
    assert one["weight_of_cores"] < both["weight_of_cores"]
    assert one["level_vwc_sd"] < one["level_vwc_sd_before"]


def test_cores_that_contradict_the_general_calibration_are_doubted(calibrate):
    answer = calibrate(cores_of(0.25), site=SITE + SOIL + "sensor_sensitivity: 3.0\n", counts=2500)
    assert answer["disagreement_sd"] > 2
    assert any("contradict each other" in text for text in answer["warnings"])


def test_an_earlier_day_at_this_site_sharpens_and_the_same_day_is_refused(calibrate, tmp_path):
    calibrate("date,vwc\n2025-05-02,0.24\n2025-05-02,0.27\n2025-05-02,0.26\n", counts=2500)
    before = tmp_path / "before.yaml"
    before.write_text((tmp_path / "site.yaml").read_text())
    later = "date,vwc\n2026-05-02,0.24\n2026-05-02,0.27\n2026-05-02,0.26\n"
    alone, both = calibrate(later, counts=2500), calibrate(later, "--earlier", before, counts=2500)
    assert both["n0_cps"] == pytest.approx(alone["n0_cps"], rel=1e-4)
    parts = load_site(tmp_path / "site.yaml").calibration.parts
    assert [part.source for part in parts if part.name == "cores"] == ["measured", "given"]
    of_day = alone["n0_sd_cps"] / alone["n0_cps"]
    assert both["n0_sd_cps"] / both["n0_cps"] == pytest.approx((of_day**2 + DAY_SD**2) ** 0.5 / 2**0.5, rel=0.01)
    (error,) = calibrate(later.replace("2026", "2025"), "--earlier", before)["errors"]
    assert "its cores would count twice" in error["message"]


def test_an_earlier_calibration_at_another_site_is_scaled_and_weighs_as_sites_differ(calibrate, tmp_path):
    other = SITE.replace("51.5", "46.5").replace("190", "1500")
    calibrate(cores_of(0.25), site=other + SOIL, counts=3000)
    before = tmp_path / "before.yaml"
    before.write_text((tmp_path / "site.yaml").read_text())
    there = load_site(before)
    alone = calibrate(cores_of(0.25), counts=1800)
    both = calibrate(cores_of(0.25), "--earlier", before, counts=1800)
    air = SurveyAir()
    here, away = (
        general_calibration(site.model_copy(update={"sensor_sensitivity": 1.0, "soil": None}), air)[0].n0_cps
        for site in (load_site(tmp_path / "site.yaml"), there)
    )
    assert here > 1.1 * away  # at one pressure; the cutoff rigidity is larger there
    n0_cps, sd = there.calibration.n0_cps * here / away, there.calibration.n0_sd_cps / there.calibration.n0_cps
    of_day = alone["n0_sd_cps"] / alone["n0_cps"]
    precision = [1 / (of_day**2 + DAY_SD**2), 1 / (sd**2 + 2 * GENERAL_SD**2)]
    assert both["weight_of_cores"] == pytest.approx(precision[0] / sum(precision), rel=1e-3)
    expected = np.average(np.log([alone["n0_cps"], n0_cps]), weights=precision)
    assert np.log(both["n0_cps"]) == pytest.approx(expected, abs=1e-4)
    before.write_text(before.read_text().replace(", altitude_m: 1500", ""))
    (error,) = calibrate(cores_of(0.25), "--earlier", before, counts=1800)["errors"]
    assert error["message"].startswith("has no location with altitude_m")
    assert error["path"].endswith("before.yaml")


def thin(log, share):
    """A sensor next to the station of a log for 120 h: independent Poisson counts, fewer by a share."""
    rng = np.random.default_rng(4)
    lines = log.read_text().splitlines()[:124]
    for number, line in enumerate(lines[4:], 4):
        cells = line.split(",")
        cells[10:12] = [str(rng.poisson(share * float(cell))) for cell in cells[10:12]]
        lines[number] = ",".join(cells)
    return "\n".join(lines)


@pytest.mark.slow
def test_the_sensitivity_of_a_sensor_next_to_a_station(tmp_path):
    station = Path(__file__).parents[2] / "examples" / "station_kansas_2021-10.dat"
    (tmp_path / "own.dat").write_text(thin(station, 0.4))
    site = tmp_path / "site.yaml"
    kansas = Path(__file__).parents[2] / "config" / "sites" / "station_kansas.yaml"
    site.write_text(kansas.read_text().partition("calibration:")[0])

    def compare(*options, own=("--log", tmp_path / "own.dat")):
        arguments = ["calibrate", "--beside", station, *own, "--site", site, "--json", *options]
        return json.loads(CliRunner().invoke(main, [str(each) for each in arguments]).stdout)

    assert "nothing is known of the station" in compare()["errors"][0]["message"]
    for same in (station, tmp_path / "copy.dat"):
        (tmp_path / "copy.dat").write_text(station.read_text())
        same = compare("--station-sensitivity", 2, "--log", same, own=())["errors"][0]
        assert "record by record: they are of one sensor" in same["message"]
    before = site.read_text()
    for wrong in (1000, "nan", 0.001):
        assert "--station-sensitivity of" in compare("--station-sensitivity", wrong)["errors"][0]["message"]
    assert "makes a sensitivity of" in compare("--station-sensitivity", 0.06)["errors"][0]["message"]
    assert site.read_text() == before
    found = compare("--station-sensitivity", 2, "--station-sensitivity-sd", 0.1)
    assert found["sensor_sensitivity"] == pytest.approx(0.8, abs=3 * 2 * found["ratio_sd"])
    assert found["sensor_sensitivity_sd"] == pytest.approx(0.04, rel=0.02)
    assert site.read_text().startswith("# Site of the public records")
    again = compare("--station-sensitivity", 6, "--dry-run")["warnings"]
    assert any("contradicts that of the site file, 0.8" in text for text in again)
    assert any("both logs have the serial number" in text for text in again)
    assert load_site(site).sensor_sensitivity == pytest.approx(found["sensor_sensitivity"], abs=1e-4)
    stated = tmp_path / "stated.yaml"
    stated.write_text(kansas.read_text() + "sensor_sensitivity: 1.5\nsensor_sensitivity_sd: 0.15\n")
    by_file = compare("--station-site", stated)
    assert by_file["sensor_sensitivity"] / by_file["ratio"] == pytest.approx(1.5, abs=1e-9), "not by its N0"
    assert by_file["sensor_sensitivity_sd"] / by_file["sensor_sensitivity"] == pytest.approx(0.1, rel=0.05)
    given = compare("--station-site", stated, "--station-sensitivity", 2)
    assert given["sensor_sensitivity"] / given["ratio"] == pytest.approx(2), "what is given goes first"
    by_n0 = compare("--station-site", kansas)
    assert by_n0["sensor_sensitivity"] / by_n0["ratio"] == pytest.approx(0.81, abs=0.01)
    assert by_n0["sensor_sensitivity_sd"] / by_n0["sensor_sensitivity"] > 0.035  # sites differ
