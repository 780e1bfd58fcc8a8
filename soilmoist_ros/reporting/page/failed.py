# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The page of a run that made no map."""

from __future__ import annotations

from soilmoist_ros.foundation import __version__
from soilmoist_ros.pipeline import FailedRun, track_xy
from soilmoist_ros.reporting.page import wording
from soilmoist_ros.reporting.page.charts.chart import Chart
from soilmoist_ros.reporting.page.charts.survey_charts import rate_chart
from soilmoist_ros.reporting.page.frame import render_page
from soilmoist_ros.reporting.page.numbers import duration, length, number
from soilmoist_ros.reporting.page.wording import Fact

MAX_VISITS = 100
MAX_LINES = 1000


def render_failed(failed: FailedRun) -> str:
    """The page as HTML: why there is no map, what to do, and what was counted."""
    mission = failed.mission
    return render_page(
        "failed.html.j2",
        title=failed.title,
        version=__version__,
        place=failed.field_name,
        when=wording.survey_time(failed),
        where=wording.place(failed),
        simulated=failed.simulated,
        failed=failed,
        facts=failed_facts(failed),
        visits=mission.visits[:MAX_VISITS] if mission else (),
        stops=len(mission.visits) if mission else 0,
        log=mission.log[:MAX_LINES] if mission else (),
        rate=_rate(failed),
    )


def failed_facts(failed: FailedRun) -> list[Fact]:
    """What was counted, and how far the run came."""
    good, placed = failed.good, len(track_xy(failed.good))
    counts, seconds = sum(record.raw_counts for record in good), sum(record.exposure_s for record in good)
    found = [Fact(str(len(good)), "", "records" if len(good) != 1 else "record")]
    if failed.quarantined:
        found.append(Fact(str(failed.quarantined.total()), "", "records quarantined"))
    if good:
        found += [
            Fact(str(placed), "", "records with a place"),
            Fact(str(counts), "", f"counts in {duration(seconds)}"),
            Fact(number(counts / seconds) if seconds > 0 else "–", "counts/s", "mean raw rate"),
        ]
    if failed.mission is not None:
        found.append(Fact(str(len(failed.mission.visits)), "", "stops finished"))
        if failed.mission.series:
            found.append(Fact(duration(failed.mission.series[-1].time_s), "", "of mission time"))
    if placed or failed.mission is not None:
        value, unit = length(failed.travelled_m)
        found.append(Fact(value, unit, "travelled"))
    return found


def _rate(failed: FailedRun) -> Chart | None:
    """The rate over time, ``None`` without at least two records that count."""
    good = [record for record in failed.good if record.effective_exposure_s > 0]
    if len({record.stamp_s for record in good}) < 2:
        return None
    return rate_chart(good)
