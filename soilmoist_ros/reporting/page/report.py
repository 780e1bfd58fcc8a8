"""``report.html``: the report of a run in one self-contained file."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from soilmoist_ros.mapping.variogram.model import Variogram
from soilmoist_ros.reporting.moisture_series import at_one_place, moisture_series
from soilmoist_ros.reporting.page import maps, numbers, wording
from soilmoist_ros.reporting.page.charts import survey_charts as charts
from soilmoist_ros.reporting.page.frame import render_page
from soilmoist_ros.reporting.page.mission_section import mission_part
from soilmoist_ros.reporting.page.notes import notes
from soilmoist_ros.reporting.page.properties_section import property_sections, side_by_side
from soilmoist_ros.reporting.page.section import Section
from soilmoist_ros.reporting.page.statistics import TruthScore, leave_one_out, truth_score
from soilmoist_ros.reporting.page.style import picture
from soilmoist_ros.reporting.run import MapRun

MAX_READOUT_CELLS = 150
"""Maximum cells along each axis of the embedded grid, which shows values under the pointer."""

FITS = {"reml": "restricted maximum likelihood", "soft_l1": "robust least squares on the lag classes"}


def write_report(path: Path, run: MapRun) -> Path:
    """Write the report; return ``path``."""
    path.write_text(render_report(run), encoding="utf-8")
    return path


def render_report(run: MapRun) -> str:
    """The report as HTML."""
    return render_page(
        "report.html.j2",
        title=run.title,
        version=run.version,
        place=run.field_name,
        when=wording.survey_time(run),
        where=wording.place(run),
        simulated=run.simulated,
        run=run,
        curve=run.soil_map.curve,
        facts=wording.facts(run),
        headline=wording.headline(run),
        notes=notes(run),
        maps=list(_maps(run)),
        properties=side_by_side(run),
        property_sections=property_sections(run),
        mission=mission_part(run),
        charts=list(_charts(run)),
        truth=_truth(run),
        variogram=_variogram_rows(run),
        lost=sum(row.count for row in run.losses if row.consequence == "lost"),
        datum=maps.datum_text(run),
        readout=readout(run),
    )


def readout(run: MapRun) -> dict[str, Any]:
    """The main map as integers for the page's script: hundredths of % by volume, or 1/1000 counts/s.

    The grid is thinned to at most 150 x 150 cells; rows run from south to north; ``None`` is undefined.
    """
    soil_map, grid = run.soil_map, run.soil_map.grid
    step = max(1, -(-max(soil_map.rate.shape) // MAX_READOUT_CELLS))
    names, factor = (("vwc", "vwc_sd"), 1e4) if run.calibrated else (("rate", "rate_sd"), 1e3)
    first = step // 2 if min(soil_map.rate.shape) > step // 2 else 0
    thin = slice(first, None, step)
    value, sd = (_integers(getattr(soil_map, name)[thin, thin], factor) for name in names)
    west, east, south, north = maps.view(run)
    return {
        "view": [west, east, south, north],
        "x0": float(grid.x_m[first]),
        "y0": float(grid.y_m[first]),
        "step": float(grid.cell_m * step),
        "value": value,
        "sd": sd,
        "factor": 100 / factor if run.calibrated else 1 / factor,
        "digits": 1 if run.calibrated else 2,
        "unit": "% by volume" if run.calibrated else "counts/s",
    }


def _integers(values: Any, factor: float) -> list[list[int | None]]:
    scaled = np.asarray(values, float) * factor
    return [[round(v) if np.isfinite(v) else None for v in row] for row in scaled.tolist()]


def _maps(run: MapRun) -> Iterator[Section]:
    """The maps, the most important first."""
    where = run.field_name or "the field"
    if run.calibrated:
        alt = f"Map of the soil water content of {where}; {' '.join(wording.headline(run)[1:2])}"
        yield Section(
            "vwc", "Soil water content", picture(maps.band_map(run, maps.VWC, width_in=maps.WIDE_IN), alt),
            "Dark blue is wet, pale is dry. White dots are the places that were measured.",
        )  # fmt: skip
        alt = f"Map of the standard deviation of the soil water content of {where}"
        yield Section(
            "vwc-sd", "How sure is it?", picture(maps.band_map(run, maps.VWC_SD), alt),
            "One standard deviation of the water content at each place. Dark is uncertain: far from "
            "measurements, or wet, where a small change of the rate means a large change of water.",
        )  # fmt: skip
    width = maps.NARROW_IN if run.calibrated else maps.WIDE_IN
    alt = f"Map of the corrected neutron count rate of {where}"
    yield Section(
        "rate", "Neutron count rate", picture(maps.band_map(run, maps.RATE, width_in=width), alt),
        "What was measured, corrected for the atmosphere. More neutrons mean drier soil.",
    )  # fmt: skip
    alt = f"Map of the standard deviation of the count rate of {where}"
    yield Section(
        "rate-sd", "Uncertainty of the rate", picture(maps.band_map(run, maps.RATE_SD), alt),
        "One standard deviation of the true rate, given all counts.",
    )  # fmt: skip
    yield Section(
        "samples", "Samples and track", picture(maps.samples_map(run), "Map of the samples and the track"),
        "Each sample in the colour of its own rate, counting noise included; larger dots were counted longer.",
    )  # fmt: skip
    if run.truth_rate is not None:
        figure = maps.band_map(run, maps.RATE, np.asarray(run.truth_rate, float))
        yield Section(
            "truth", "True rate of the simulated field" if run.simulated else "True rate",
            picture(figure, f"Map of the true count rate of {where}"),
            "What the rate map should show, in the same colours.",
        )  # fmt: skip
        yield Section(
            "error", "Error of the rate map",
            picture(maps.error_map(run), f"Map of the error of the count rate of {where}"),
            "Estimate minus truth: purple where the map shows more neutrons (drier soil) than there are, "
            "orange where fewer, white where it is right.",
        )  # fmt: skip


def _charts(run: MapRun) -> Iterator[Section]:
    if at_one_place(run) and run.calibrated:
        series = moisture_series(run.track, run.soil_map.curve)
        yield Section(
            "moisture-series", "Soil moisture over time",
            picture(charts.moisture_chart(series), "Soil moisture over time", True),
            "Records added up in steps of time. The band holds the true moisture nine times in ten; the "
            "uncertainty of the calibration, where it is known, shifts all values together.",
        )  # fmt: skip
    yield Section(
        "variogram", "Variogram",
        picture(charts.variogram_chart(run), "Semivariance against distance", True),
        "How much two places differ, on average, by their distance. Circles: counts in classes of distance, "
        "counting noise taken out; blue: the model used for the map; orange: counting noise of a typical sample."
        + _direction(run.soil_map.variogram),
    )  # fmt: skip
    loo = leave_one_out(run.soil_map)
    if loo is not None:
        yield Section(
            "validation", "Cross-validation",
            picture(charts.cross_validation_chart(loo), "Observed against predicted rate of each sample", True),
            "Each sample predicted from all others; bars: one standard deviation of the difference, counting "
            f"noise included. {numbers.percent(loo.coverage95)} of the {len(loo.observed)} samples lie in their "
            f"95 % interval; errors are {loo.standardised_sd:.2f} times as large as stated (1 is right); root "
            f"mean square error {numbers.number(loo.rmse)} counts/s.",
        )  # fmt: skip
    yield Section(
        "histogram", "Distribution",
        picture(charts.histogram_chart(run), "Histograms of map and samples", True),
        "The samples carry counting noise and stand only where the sensor was; the map is smoother and covers "
        "the field.",
    )  # fmt: skip
    if len({record.stamp_s for record in run.track}) > 1:
        yield Section(
            "rate-series", "Rate over time",
            picture(charts.rate_chart(run.track), "Corrected count rate over time", True),
            "Changes beyond the band are real: other soil below the sensor, or a fault.",
        )  # fmt: skip
        yield Section(
            "factors", "Correction factors over time",
            picture(charts.factor_chart(run.track), "Correction factors over time", True),
            "The factors that the raw counts are multiplied with.",
        )  # fmt: skip


def _truth(run: MapRun) -> TruthScore | None:
    return None if run.truth_rate is None else truth_score(run.soil_map, run.truth_rate)


def _variogram_rows(run: MapRun) -> list[tuple[str, str, str]]:
    """Name, value and unit of each model parameter."""
    soil_map, variogram, fit = run.soil_map, run.soil_map.variogram, run.soil_map.fit
    errors = (None, None, None) if fit is None or fit.log_sd is None else fit.log_sd
    sill_factor, range_factor, nugget_factor = (_factor(error) for error in errors)
    return [
        ("model", str(variogram.model), ""),
        ("fitted by", "given, not fitted" if fit is None else FITS.get(fit.method, fit.method), ""),
        ("nugget", numbers.number(variogram.nugget) + nugget_factor, "(counts/s)²"),
        ("sill above the nugget", numbers.number(variogram.structured_sill) + sill_factor, "(counts/s)²"),
        ("total sill", numbers.number(variogram.sill), "(counts/s)²"),
        ("range parameter", numbers.number(variogram.range_m) + range_factor, "m"),
        ("practical range (95 % of the sill)", numbers.number(variogram.practical_range_m), "m"),
        ("mean rate", numbers.number(soil_map.mean_rate, 4), "counts/s"),
        ("samples", str(len(soil_map.samples.xy)), ""),
        ("cells inside the field", str(np.count_nonzero(soil_map.grid.mask)), ""),
        ("cell size", numbers.number(soil_map.grid.cell_m), "m"),
    ]


def _direction(variogram: Variogram) -> str:
    """A sentence on the direction of the longest range, if the model is anisotropic."""
    if variogram.anisotropy == 1:
        return ""
    root = np.sqrt(variogram.anisotropy)
    longest, shortest = (variogram.practical_range_m * factor for factor in (root, 1 / root))
    return (
        f" The range depends on the direction: the practical range is {numbers.number(longest)} m along "
        f"{variogram.angle_deg:.3g}° (anticlockwise from east) and {numbers.number(shortest)} m "
        "across; the blue curve is that of their geometric mean."
    )


def _factor(log_sd: float | None) -> str:
    """The standard error of a logarithm as a multiplicative factor."""
    return "" if log_sd is None or not 0 < log_sd < 3 else f" ×/÷ {np.exp(log_sd):.2g}"
