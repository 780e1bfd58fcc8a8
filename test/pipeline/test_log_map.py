# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Logs of a survey, mapped by the Python API."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from soilmoist_ros.foundation import InputError, LocalFrame, Mistake, config_folder
from soilmoist_ros.mapping import CovariateSource, load_field
from soilmoist_ros.pipeline import MapSettings, NoteCode, map_logs
from soilmoist_ros.pipeline.log_map import loss_rows, with_side
from soilmoist_ros.reporting import notes, summary
from soilmoist_ros.sensing import Kind, Problem, Site
from soilmoist_ros.simulation.robot.scenario import SensorFaults
from virtual_survey import write_survey


@pytest.fixture(scope="module")
def survey(tmp_path_factory):
    folder = tmp_path_factory.mktemp("survey")
    write_survey(folder, seed=2, spacing_m=30.0, dwell_s=60.0)
    return folder


def settings(survey, **changes):
    files = {"site": survey / "site.yaml", "field": survey / "field.yaml", "nmea": (survey / "survey.nmea",)}
    return MapSettings(**{**files, **changes})


@pytest.mark.slow
def test_bad_counts_are_listed_and_not_mapped(survey, tmp_path):
    wild = [{"tube": tube, "nth": 20, "counts": 100_000} for tube in range(1, 13)]
    weather = {"quantity": "pressure_hpa", "value": 300, "at_s": 100, "for_s": 30}
    dead = {"tube": 3, "kind": "factor", "value": 0, "at_s": 250, "for_s": 1e9}
    faults = SensorFaults.model_validate({"counts": wild, "weather": [weather], "tubes": [dead]})
    write_survey(tmp_path, seed=2, spacing_m=30.0, dwell_s=60.0, faults=faults)
    good = map_logs([survey / "survey.log"], settings(survey))
    run = map_logs([tmp_path / "survey.log"], settings(survey))
    assert not good.quarantined
    assert [(record.quarantine, record.raw_counts) for record in run.quarantined] == [
        ("impossible_count", 1_200_000)
    ]
    assert len(run.track) + 1 == len(good.track) == len(run.all_records)
    rows = {row.kind: row for row in run.losses}
    assert rows["impossible count"].consequence == "quarantined"
    assert "100000 counts in 10 s" in rows["impossible count"].example
    assert rows["impossible weather"].consequence == rows["tube counts too little"].consequence == "kept"
    assert all(row.remedy for row in rows.values())
    codes = [note.code for note in notes(run)]
    assert NoteCode.QUARANTINED in codes
    assert NoteCode.BAD_TUBES in codes
    assert np.nanmean(run.soil_map.rate) == pytest.approx(np.nanmean(good.soil_map.rate), rel=0.02)
    assert summary(run)["n_quarantined"] == {"impossible_count": 1}


def test_losses_come_first_and_the_most_frequent_of_them():
    kinds = [Kind.GAP, Kind.NO_POSITION, Kind.CHECKSUM]
    problems = [Problem(kinds[0], Mistake("once"), False)]
    problems += [Problem(kinds[1], Mistake("twice"), True)] + 2 * [Problem(kinds[2], Mistake("often"), True)]
    rows = loss_rows(problems)
    assert [(row.count, row.consequence) for row in rows] == [(2, "lost"), (1, "lost"), (1, "kept")]
    assert [row.example for row in rows] == ["often", "twice", "once"]


def kansas(folder, corners, name="Kansas"):
    path = folder / "field.yaml"
    path.write_text(f"name: {name}\npolygon_lonlat: {corners}\n")
    return path


def refusal(log, **files):
    with pytest.raises(InputError) as caught:
        map_logs([log], MapSettings(**files))
    return str(caught.value)


@pytest.mark.slow
def test_a_field_beyond_the_correlation_range_is_refused(survey, tmp_path):
    """The first check allows the extent of the field; the fitted variogram says how far the counts reach."""
    frame = load_field(survey / "field.yaml").frame
    corners = frame.to_geographic([(700.0, 0.0), (2000.0, 0.0), (2000.0, 60.0), (700.0, 60.0)])[:, ::-1].tolist()
    said = refusal(
        survey / "survey.log", nmea=(survey / "survey.nmea",), site=survey / "site.yaml",
        field=kansas(tmp_path, corners, "next"), cell_m=20.0,
    )  # fmt: skip
    assert "west (be" in said
    assert "beyond the correlation range of" in said


@pytest.mark.slow
def test_positions_that_span_a_country_are_refused_without_a_field(roving_record, tmp_path):
    lines = roving_record.read_text().splitlines()
    placed = [number for number, line in enumerate(lines) if "38.7" in line]
    for number in placed[:60]:
        lines[number] = lines[number].replace("38.7", "28.7")
    (tmp_path / "log.KSU").write_text("\n".join(lines) + "\n")
    said = refusal(tmp_path / "log.KSU", site=config_folder() / "sites" / "gypsum_transect.yaml")
    assert "the records lie up to 1,11" in said
    assert "--field" in said


@pytest.mark.slow
def test_a_site_of_another_place_is_noted(survey, tmp_path):
    site = tmp_path / "site.yaml"
    site.write_text((survey / "site.yaml").read_text() + "location: {latitude_deg: 53.268, longitude_deg: 3.5}\n")
    run = map_logs([survey / "survey.log"], settings(survey, site=site, cell_m=10.0))
    (note,) = [note for note in run.notes if note.code is NoteCode.FAR_FROM_SITE]
    assert "of the place of the site" in note.message


@pytest.mark.slow
def test_covariates_of_the_field_and_of_the_settings(survey, tmp_path):
    import rasterio
    from rasterio.transform import Affine

    field = load_field(survey / "field.yaml")
    values = np.add.outer(np.arange(60.0), np.arange(60.0)).astype("float32")
    with rasterio.open(
        tmp_path / "image.tif", "w", driver="GTiff", width=60, height=60, count=1, dtype="float32",
        crs=field.frame.crs.to_wkt(), transform=Affine(1, 0, -5, 0, -1, 55), nodata=-1,
    ) as file:  # fmt: skip
        file.write(values, 1)
    text = (survey / "field.yaml").read_text() + f"\ncovariates: [{tmp_path / 'image.tif'}]\n"
    (tmp_path / "field.yaml").write_text(text)
    more = (CovariateSource(tmp_path / "image.tif", name="again"),)
    run = map_logs([survey / "survey.log"], settings(survey, field=tmp_path / "field.yaml", covariates=more))
    assert run.covariates.names == ("image", "again")
    assert [item.role for item in run.inputs][-1] == "covariate"
    with pytest.raises(InputError, match="no such file"):
        map_logs([survey / "survey.log"], settings(survey, covariates=(CovariateSource(tmp_path / "none.tif"),)))


@pytest.mark.parametrize(
    ("east_deg", "given", "side"),
    [(-97.4, {}, "west"), (13.0, {}, "east"), (0.4, {}, "signed"), (-179.5, {}, "signed"),
     (13.0, {"longitude": "west"}, "west"), (-97.4, {"longitude": "signed"}, "signed")],
)  # fmt: skip
def test_longitudes_without_a_sign_are_on_the_side_of_the_field(east_deg, given, side):
    field = SimpleNamespace(frame=LocalFrame(38.7, east_deg))
    assert with_side(Site(**given), field).longitude == side
    assert with_side(Site(**given), None).longitude == given.get("longitude", "signed")
