# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Fields as soil texture makes them: zones of sand and clay with gradual borders, and finer variation inside."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from soilmoist_ros.simulation.fields.formula_base import Positive, RateFormula, Truth
from soilmoist_ros.simulation.fields.random_field import random_field
from soilmoist_ros.simulation.fields.rate_grid import Extent, RateGrid


class Texture(RateFormula):
    """Zones and finer variation between two limits; every value between them covers the same area on average.

    The value is ``low + (high - low) Phi(z)`` with ``z = sqrt(1 - fine) zones + sqrt(fine) inside``: two
    independent Gaussian random fields of variance 1 (Matern 3/2), and the normal distribution function Phi.
    """

    values: ClassVar[tuple[str, ...]] = ("low", "high")

    family: Literal["texture"] = "texture"
    low: Positive
    """Value of the purest sand (moisture), or of the heaviest clay (rate)."""
    high: Positive
    """Value at the other end, greater than ``low``."""
    range_m: Positive = 40.0
    """Range parameter of the zones [m]; a zone is about twice as wide."""
    fine: Annotated[float, Field(ge=0, le=1)] = 0.1
    """Share of the variance inside zones."""
    fine_range_m: Positive = 8.0
    """Range parameter of the variation inside zones [m]."""
    seed: Annotated[int, Field(ge=0)] = 1
    """Seed of the values. Fields of one seed, boundary and cell size share their zones."""

    @model_validator(mode="after")
    def _low_is_below_high(self) -> Texture:
        if self.low >= self.high:
            raise ValueError(f"'low' must be below 'high' ({self.high:g})")
        return self

    def function(self, extent: Extent, rng: np.random.Generator | None = None) -> Truth:
        """See the base class."""
        from scipy.special import ndtr

        rng = rng or np.random.default_rng(self.seed)
        x, y = extent.axes()
        zones, inside = (
            random_field(x, y, "matern32", range_m, rng) for range_m in (self.range_m, self.fine_range_m)
        )
        share = ndtr(np.sqrt(1 - self.fine) * zones + np.sqrt(self.fine) * inside)
        return RateGrid(x, y, self.low + (self.high - self.low) * share)
