# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Random fields that are rough in some places and nearly flat in others.

Three families differ in where the field is rough: in one half, in one patch, in every other strip. The value is
``mean + a(x) sd rough(x) + (1 - a(x)) flat_sd flat(x)`` with two independent stationary Gaussian random fields of
variance 1, ``rough`` and ``flat``, and the share ``a(x)`` of rough ground, which changes smoothly from 0 to 1.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from soilmoist_ros.mapping import ModelName
from soilmoist_ros.simulation.fields.formula_base import (
    FLOOR,
    Positive,
    RateFormula,
    Truth,
    direction,
    smooth_step,
)
from soilmoist_ros.simulation.fields.random_field import random_field
from soilmoist_ros.simulation.fields.rate_grid import Extent, RateGrid

Array = NDArray[np.float64]


class UnevenField(RateFormula):
    """Base class of random fields of uneven roughness. Values below 5 % of the mean are raised to that."""

    values: ClassVar[tuple[str, ...]] = ("mean",)

    mean: Positive
    """Mean of the quantity."""
    sd: Positive
    """Standard deviation on rough ground, at most a quarter of the mean."""
    flat_sd: Annotated[float, Field(ge=0)] = 0.0
    """Standard deviation on flat ground, at most ``sd``."""
    model: ModelName = "matern32"
    """Variogram model of rough and flat ground."""
    range_m: Positive = 10.0
    """Range parameter on rough ground [m], as in :class:`.RandomFieldFormula`."""
    flat_range_m: Positive | None = None
    """Range parameter on flat ground [m]; by default that of rough ground."""
    transition_m: Positive = 4.0
    """Width of the transition from rough to flat ground, which contains three quarters of the change [m]."""
    seed: Annotated[int, Field(ge=0)] = 1
    """Seed of the values, and of the place or direction where it is not given."""

    @model_validator(mode="after")
    def _stays_positive(self) -> UnevenField:
        if self.sd > self.mean / 4:
            raise ValueError(f"'sd' must be at most a quarter of 'mean' ({self.mean / 4:g}) to stay positive")
        if self.flat_sd > self.sd:
            raise ValueError(f"'flat_sd' must be at most 'sd' ({self.sd:g}), the variation of the rough ground")
        return self

    def function(self, extent: Extent, rng: np.random.Generator | None = None) -> Truth:
        """See the base class."""
        rng = rng or np.random.default_rng(self.seed)
        x, y = extent.axes()
        places = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        share = self.rough_share(places, extent, rng).reshape(len(y), len(x))
        rough, flat = (
            random_field(x, y, self.model, range_m, rng)
            for range_m in (self.range_m, self.flat_range_m or self.range_m)
        )
        values = self.mean + share * self.sd * rough + (1 - share) * self.flat_sd * flat
        return RateGrid(x, y, np.maximum(values, FLOOR * self.mean))

    def rough_share(self, xy: Array, extent: Extent, rng: np.random.Generator) -> Array:
        """Share of rough ground at places of shape (n, 2) [m]: from 0, flat, to 1, rough; shape (n,)."""
        raise NotImplementedError


class Halves(UnevenField):
    """One rough and one flat half with a straight border through the middle of the field."""

    family: Literal["halves"] = "halves"
    angle_deg: float | None = None
    """Direction from the flat to the rough half [deg]; drawn from the seed if left out."""

    def rough_share(self, xy: Array, extent: Extent, rng: np.random.Generator) -> Array:
        """See the base class."""
        across = direction(_angle(self.angle_deg, rng))
        return smooth_step((xy - extent.centre) @ across, self.transition_m)


class RoughPatch(UnevenField):
    """One round rough patch in a flat field, at a place drawn from the seed."""

    family: Literal["rough_patch"] = "rough_patch"
    area: Annotated[float, Field(gt=0, le=0.5)] = 0.1
    """Area of the patch as a share of the area of the field's bounding box [-]."""

    def rough_share(self, xy: Array, extent: Extent, rng: np.random.Generator) -> Array:
        """See the base class."""
        size = extent.high - extent.low
        radius = np.sqrt(self.area * size.prod() / np.pi)
        margin = np.minimum(radius, 0.5 * size)
        centre = rng.uniform(extent.low + margin, extent.high - margin)
        return smooth_step(radius - np.hypot(*(xy - centre).T), self.transition_m)


class Strips(UnevenField):
    """Parallel strips, rough and flat in turn."""

    family: Literal["strips"] = "strips"
    width_m: Positive = 12.0
    """Width of a strip [m]."""
    angle_deg: float | None = None
    """Direction in which the strips run [deg]; drawn from the seed if left out."""

    def rough_share(self, xy: Array, extent: Extent, rng: np.random.Generator) -> Array:
        """See the base class."""
        across = direction(_angle(self.angle_deg, rng) - 90)
        first = rng.uniform(0, 2 * self.width_m)
        position = ((xy - extent.centre) @ across - first) % (2 * self.width_m)
        return smooth_step(self.width_m / 2 - np.abs(position - self.width_m), self.transition_m)


def _angle(given_deg: float | None, rng: np.random.Generator) -> float:
    """The angle given, or one drawn from all directions [deg]."""
    return float(rng.uniform(0, 360)) if given_deg is None else given_deg
