# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What earlier surveys contribute to a run, and what has changed in the field since the last of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from soilmoist_ros.mapping import (
    Estimate,
    FieldChange,
    JointKriging,
    Persistence,
    PoissonKriging,
    SoilMap,
    field_change,
    mean_places,
)
from soilmoist_ros.reporting.earlier.earlier_runs import EarlierRun

MAX_SAMPLES = 1500
"""Number of samples of all surveys up to which a change is computed; the latest earlier surveys come first."""


@dataclass(frozen=True, eq=False)
class RunChange:
    """The change of a field since an earlier survey.

    :param since: the earlier survey
    :param change: from that one to the present one
    :param persistence: how alike the patterns of the surveys are
    :param means: change of the field's mean rate since each earlier survey [counts/s], by its name
    :param sd: standard deviation of the smooth rate of a cell, typical of the map [counts/s]
    :param sd_alone: what it would be without the earlier surveys [counts/s]
    :param backwards: whether ``since`` is later than the present survey, because none is earlier
    """

    since: EarlierRun
    change: FieldChange
    persistence: Persistence
    means: dict[str, Estimate]
    sd: float
    sd_alone: float
    backwards: bool = False


def run_change(soil_map: SoilMap, stamp_s: float, earlier: Sequence[EarlierRun]) -> RunChange | None:
    """The change since the latest earlier survey; ``None`` without one, or if there are too many samples.

    :param soil_map: map of the present survey
    :param stamp_s: end of the present survey [s]
    :param earlier: earlier surveys
    """
    by_time = sorted(earlier, key=lambda run: (abs(stamp_s - run.survey.stamp_s), run.survey.name))
    before = [run for run in by_time if run.survey.stamp_s <= stamp_s]
    ordered = [*before, *(run for run in by_time if run not in before)]
    used: list[EarlierRun] = []
    count = len(soil_map.samples)
    for run in ordered:
        count += len(run.survey.samples)
        if count > MAX_SAMPLES:
            break
        used.append(run)
    if not used:
        return None
    surveys = [soil_map.samples, *(run.survey.samples for run in used)]
    stamps = [stamp_s, *(run.survey.stamp_s for run in used)]
    persistence = Persistence.estimate(soil_map.variogram, surveys, stamps)
    kriging = JointKriging(soil_map.variogram, surveys, persistence.matrix(stamps))
    # With a drift or a reference sensor, the samples are as at the end of the survey: but for a common error.
    shared = soil_map.made_by.shared if isinstance(soil_map.made_by, PoissonKriging) else None
    change = field_change(kriging, soil_map.grid, 0, 1, soil_map.curve, shared=shared)
    means = {used[0].survey.name: change.mean_rate}
    places, share = mean_places(soil_map.grid)
    errors = np.zeros((len(places), 1)) if shared is None else shared(places)
    for number, run in enumerate(used[1:], 2):
        value, variance = kriging.mean(places, {0: share, number: -share})
        means[run.survey.name] = Estimate(value, math.sqrt(variance + float(((share @ errors) ** 2).sum())))
    alone = JointKriging(soil_map.variogram, surveys[:1], np.eye(1))
    of_cell = (errors**2).sum(axis=1)
    sd, sd_alone = (math.sqrt(float(share @ (one.predict(places, 0)[1] + of_cell))) for one in (kriging, alone))
    return RunChange(used[0], change, persistence, means, sd, sd_alone, not before)
