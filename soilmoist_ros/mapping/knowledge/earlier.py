"""Earlier surveys of a field: their counts, not their maps."""

from __future__ import annotations

import math
from dataclasses import dataclass

from soilmoist_ros.foundation import DAY_S
from soilmoist_ros.mapping.samples.samples import Samples


@dataclass(frozen=True, eq=False)
class EarlierSurvey:
    """The samples of an earlier survey of the field.

    :param name: how reports and messages name it
    :param stamp_s: time of the survey, for instance its end [s since 1970-01-01 UTC]
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

    def days_before(self, stamp_s: float) -> float:
        """Days from this survey to a time, >= 0 whichever is first."""
        return abs(stamp_s - self.stamp_s) / DAY_S
