# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Knowledge of a field besides the counts of the survey: earlier surveys (their counts), covariates, drift."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from soilmoist_ros.mapping.covariates import Covariates
from soilmoist_ros.mapping.drift import MAX_SAMPLES, WINDOW_S, TimedSamples, find_change
from soilmoist_ros.mapping.records import SampleMerger, driven_spreads, survey_samples
from soilmoist_ros.mapping.samples import Samples
from soilmoist_ros.mapping.variogram.fit import estimate_variogram
from soilmoist_ros.sensing import CountRecord


@dataclass(frozen=True, eq=False)
class EarlierSurvey:
    """The samples of an earlier survey of the field.

    :param name: how reports and messages name it
    :param samples: its samples, at least one, in metres of the present field's frame
    :raises ValueError: without samples, or if the time is not finite
    """

    name: str
    stamp_s: float
    samples: Samples

    def __post_init__(self) -> None:
        if not len(self.samples):
            raise ValueError(f"the earlier survey {self.name!r} has no samples; leave it out")
        if not math.isfinite(self.stamp_s):
            raise ValueError(f"stamp_s of the earlier survey {self.name!r} must be finite, got {self.stamp_s}")


def samples_at_end(
    records: Sequence[CountRecord], radius_m: float, footprint_radius_m: float, extent_m: float
) -> Samples:
    """Samples of a whole survey as they would have been counted at its end, if the mean rate changed meanwhile.

    The mean of the drift (:mod:`.drift`) corrects the exposures; its uncertainty is not in the samples.
    """
    spread = driven_spreads(records)
    samples = survey_samples(records, radius_m, footprint_radius_m, spread)
    if len(samples) > MAX_SAMPLES:
        return samples
    merger = SampleMerger(radius_m, footprint_radius_m, WINDOW_S)
    merger.add_records(records, spread)
    timed, one = TimedSamples(merger.samples, merger.time_s), merger.samples
    fit = estimate_variogram(
        samples.xy, samples.counts, samples.exposure_s, extent_m=extent_m, spread=samples.spread, local_noise=True
    )
    end_s = records[-1].stamp_s
    drift = find_change(timed, end_s, fit.variogram, fit.noise_rate, places=samples).drift
    if drift is None:
        return samples
    at_end, exposure_s = SampleMerger(radius_m, footprint_radius_m), one.exposure_s * drift.factor(timed.time_s)
    for (x_m, y_m), counts, seconds, path in zip(one.xy, one.counts, exposure_s, one.spread, strict=True):
        at_end.add(x_m, y_m, counts, seconds, path)
    return at_end.samples


# -- Knowledge -----------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Knowledge:
    """Knowledge of a field besides the counts of the survey.

    :param earlier: earlier surveys of the field, in any order
    :param covariates: covariates over the field; ``None`` for none
    :raises ValueError: if two earlier surveys have one name
    """

    earlier: tuple[EarlierSurvey, ...] = ()
    covariates: Covariates | None = None

    def __post_init__(self) -> None:
        repeated = [name for name, count in Counter(one.name for one in self.earlier).items() if count > 1]
        if repeated:
            raise ValueError(f"the earlier survey {repeated[0]!r} is given twice")

    @property
    def is_empty(self) -> bool:
        """True if no other survey and no covariate is known, and the fit is that of the survey alone."""
        return not self.earlier and not self.covariates


NOTHING = Knowledge()  # nothing is known besides the counts of the survey
