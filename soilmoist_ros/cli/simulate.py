"""``soilmoist simulate``: simulate one mission on a surrogate field."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import click

from soilmoist_ros.cli.answers.answer import answering, say, wrote
from soilmoist_ros.cli.answers.map_lines import print_knowledge, print_notes, rate_error
from soilmoist_ros.cli.answers.progress import progress_bar
from soilmoist_ros.cli.options.knowledge_options import covariate_option, earlier_option
from soilmoist_ros.cli.options.mission_options import chosen_settings, mission_options
from soilmoist_ros.cli.options.output_options import output_options, prepare_output


@click.command("simulate")
@mission_options()
@earlier_option(" Not for a series of simulated surveys: --earlier-surveys.")
@covariate_option()
@output_options()
@answering
def command(
    out: Path, overwrite: bool, earlier: tuple[Path, ...], covariates: tuple[str, ...], choices: dict[str, Any]
) -> None:
    """Explore a surrogate field with a simulated robot, without ROS.

    Writes summary.json, map.tif, samples.geojson, report.html, series.csv and visits.csv to the folder --out.
    Each additional property NAME also gets map_NAME.tif and samples_NAME.geojson.
    """
    from soilmoist_ros.exploration.travel.travel import polyline_length_m
    from soilmoist_ros.mapping.covariates.source import CovariateSource
    from soilmoist_ros.reporting.earlier.mission_earlier import mission_earlier
    from soilmoist_ros.reporting.mission_report import mission_run, write_mission
    from soilmoist_ros.simulation.mission.efficiency import mission_efficiency
    from soilmoist_ros.simulation.mission.forecasts import forecast_text
    from soilmoist_ros.simulation.mission.simulator import simulate_mission

    settings = chosen_settings(choices)
    prepare_output(out, overwrite)
    with progress_bar() as progress:
        runs = mission_earlier(settings, earlier)
        surveys = {name: [run.survey for run in its] for name, its in runs.items()}
        sources = list(map(CovariateSource.parse, covariates))
        result = simulate_mission(settings, lambda share: progress("exploring", share), True, surveys, sources)
        progress("writing the results", 1.0)
        run = None if result.soil_map is None else mission_run(result, earlier=runs)
        written = write_mission(out, result, run=run)
    last = result.series[-1]
    say(f"mission    {last.time_s / 3600:.2f} h, {last.distance_m:.0f} m, {last.samples} samples: {result.ended}")
    if settings.robots > 1:
        say(f"robots     {', '.join(f'{polyline_length_m(track):.0f} m' for track in result.tracks)}")
    if run is None:
        say("map        no map: the mission ended before the first map update; report.html says what to do")
    else:
        say(f"rate       {rate_error(last.mse, last.coverage95)}")
        rmse = f"RMSE {last.vwc_rmse:.4f} m3/m3"
        say(f"moisture   {rmse if run.soil_map.curve else 'not mapped: the field has no calibration'}")
        for mapped, errors in zip(result.properties[1:], last.errors[1:], strict=True):
            say(f"property   {mapped.name}: {rate_error(errors.mse, errors.coverage95)}")
        for one in run.properties:
            print_knowledge(one)
        say(f"deviation  {forecast_text(result.forecasts, 3600 * settings.hours)}")
        if (plan := mission_efficiency(result)) is not None:
            say(f"efficiency {100 * plan.reached:.0f} % of the best possible plan, which need not drive")
        for one in run.properties:
            print_notes(one)
    wrote(written, out)
    if run is None:
        sys.exit(1)
