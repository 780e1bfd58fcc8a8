# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What all families of formula fields share."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from soilmoist_ros.foundation import Section
from soilmoist_ros.simulation.fields.rate_grid import Extent

Array = NDArray[np.float64]
Truth = Callable[[Array], Array]
Quantity = Literal["rate_cps", "vwc"]
Positive = Annotated[float, Field(gt=0)]

FLOOR = 0.05
"""Lower limit of random fields as a share of their mean; see :class:`.RandomFieldFormula`."""
MAX_VWC = 0.9


class RateFormula(Section):
    """Base class of all families."""

    values: ClassVar[tuple[str, ...]] = ()
    """Names of the parameters in units of the quantity."""

    family: str
    quantity: Quantity = "rate_cps"
    """Corrected rate [counts/s] or soil moisture [m^3/m^3]."""

    @model_validator(mode="after")
    def _fractions(self) -> RateFormula:
        for name in self.values:
            if self.quantity == "vwc" and getattr(self, name) > MAX_VWC:
                raise ValueError(f"{name!r} is a moisture in m3/m3 and at most {MAX_VWC}, not a percentage")
        return self

    def function(self, extent: Extent, rng: np.random.Generator | None = None) -> Truth:
        """A function of positions, shape (n, 2) [m], that returns values, shape (n,).

        :param extent: box of the field
        :param rng: source of randomness; the seed of the formula if ``None``
        """
        raise NotImplementedError


def smooth_step(distance_m: Array, width_m: float) -> Array:
    """Share that rises from 0 to 1 and is 0.5 at distance 0; three quarters of the rise lie within ``width_m``."""
    return np.asarray(0.5 * (1 + np.tanh(distance_m / (width_m / 2))))


def direction(angle_deg: float) -> Array:
    """Unit vector of an angle counted anticlockwise from east, shape (2,)."""
    angle = np.deg2rad(angle_deg)
    return np.array([np.cos(angle), np.sin(angle)])
