# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""All that is known of a field besides the counts of the survey."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

from soilmoist_ros.mapping.knowledge.covariates import Covariates
from soilmoist_ros.mapping.knowledge.drift import Drift
from soilmoist_ros.mapping.knowledge.earlier import EarlierSurvey


@dataclass(frozen=True, eq=False)
class Knowledge:
    """What is known of a field besides the counts of the survey.

    :param earlier: earlier surveys of the field, in any order
    :param covariates: covariates over the field; ``None`` for none
    :param reference: error of the correction by a reference sensor that the records have; ``None`` without one
    :raises ValueError: if two earlier surveys have one name
    """

    earlier: tuple[EarlierSurvey, ...] = ()
    covariates: Covariates | None = None
    reference: Drift | None = None

    def __post_init__(self) -> None:
        repeated = [name for name, count in Counter(one.name for one in self.earlier).items() if count > 1]
        if repeated:
            raise ValueError(f"the earlier survey {repeated[0]!r} is given twice")

    @property
    def is_empty(self) -> bool:
        """Whether no other survey and no covariate is known, and the fit is that of the survey alone."""
        return not self.earlier and not self.covariates


NOTHING = Knowledge()
"""Nothing is known besides the counts of the survey."""
