# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Families of fields that a formula and a few parameters define.

A formula computes one quantity, the corrected rate [counts/s] or the soil moisture [m^3/m^3], at any position.
Angles count anticlockwise from east. The middle of a field is the middle of its bounding box.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator, Field, ValidationError, model_validator
from pydantic_core import InitErrorDetails, PydanticCustomError

from soilmoist_ros.foundation import did_you_mean
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
from soilmoist_ros.simulation.fields.texture_formula import Texture
from soilmoist_ros.simulation.fields.uneven_formula import Halves, RoughPatch, Strips

Array = NDArray[np.float64]


class RandomFieldFormula(RateFormula):
    """A stationary Gaussian random field, drawn at the nodes of a grid (see :mod:`.random_field`).

    Values below 5 % of the mean are raised to 5 % of the mean. With a standard deviation of at most a quarter of
    the mean, this limit affects fewer than one position in 10,000.
    """

    values: ClassVar[tuple[str, ...]] = ("mean",)
    model: ClassVar[ModelName]

    mean: Positive
    """Mean of the quantity."""
    sd: Positive
    """Standard deviation of the quantity, at most a quarter of the mean."""
    range_m: Positive = 15.0
    """Range parameter of the correlation [m]. The variogram reaches 95 % of the variance at a multiple of this
    distance: 1.7 (Gaussian), 3 (exponential) or 2.7 (Matern 3/2)."""
    seed: Annotated[int, Field(ge=0)] = 1

    @model_validator(mode="after")
    def _stays_positive(self) -> RandomFieldFormula:
        if self.sd > self.mean / 4:
            raise ValueError(f"'sd' must be at most a quarter of 'mean' ({self.mean / 4:g}) to stay positive")
        return self

    def function(self, extent: Extent, rng: np.random.Generator | None = None) -> Truth:
        """See the base class."""
        x, y = extent.axes()
        noise = random_field(x, y, self.model, self.range_m, rng or np.random.default_rng(self.seed))
        return RateGrid(x, y, np.maximum(self.mean + self.sd * noise, FLOOR * self.mean))


class GaussianField(RandomFieldFormula):
    """Random field with correlation exp(-(h/range)^2): infinitely smooth."""

    family: Literal["gaussian_field"] = "gaussian_field"
    model: ClassVar[ModelName] = "gaussian"


class ExponentialField(RandomFieldFormula):
    """Random field with correlation exp(-h/range): rough."""

    family: Literal["exponential"] = "exponential"
    model: ClassVar[ModelName] = "exponential"


class Matern32Field(RandomFieldFormula):
    """Random field with Matern 3/2 correlation: smooth to the first derivative."""

    family: Literal["matern32"] = "matern32"
    model: ClassVar[ModelName] = "matern32"


class Patches(RateFormula):
    """Round patches at random positions on a uniform background."""

    values: ClassVar[tuple[str, ...]] = ("background", "patch")

    family: Literal["patches"] = "patches"
    background: Positive
    """Value between the patches."""
    patch: Positive
    """Value inside a patch."""
    count: Annotated[int, Field(ge=1, le=1000)] = 6
    """Number of patches; they may overlap."""
    radius_m: Positive = 8.0
    """Mean radius [m]; each radius is drawn between 0.6 and 1.4 times the mean."""
    edge_m: Positive = 4.0
    """Width of the edge of a patch, which contains three quarters of the change [m]."""
    seed: Annotated[int, Field(ge=0)] = 1
    """Seed of positions and radii."""

    def function(self, extent: Extent, rng: np.random.Generator | None = None) -> Truth:
        """See the base class."""
        rng = rng or np.random.default_rng(self.seed)
        centres = rng.uniform(extent.low, extent.high, (self.count, 2))
        radii = self.radius_m * rng.uniform(0.6, 1.4, self.count)

        def values(xy: Array) -> Array:
            distance = np.hypot(*(xy[:, None, :] - centres).transpose(2, 0, 1))
            share = smooth_step(radii - distance, self.edge_m).max(axis=1)
            return np.asarray(self.background + (self.patch - self.background) * share)

        return values


class Ridge(RateFormula):
    """A straight ridge (or trench) of Gaussian cross-section."""

    values: ClassVar[tuple[str, ...]] = ("background", "crest")

    family: Literal["ridge"] = "ridge"
    background: Positive
    """Value far from the ridge."""
    crest: Positive
    """Value along the middle of the ridge."""
    width_m: Positive = 10.0
    """Standard deviation of the cross-section [m]."""
    angle_deg: float = 90.0
    """Direction in which the ridge runs [deg]."""
    offset_m: float = 0.0
    """Distance of the ridge from the field's middle, to the right of its direction [m]."""

    def function(self, extent: Extent, rng: np.random.Generator | None = None) -> Truth:
        """See the base class."""
        across, middle = direction(self.angle_deg - 90), extent.centre

        def values(xy: Array) -> Array:
            distance = (xy - middle) @ across - self.offset_m
            share = np.exp(-0.5 * (distance / self.width_m) ** 2)
            return np.asarray(self.background + (self.crest - self.background) * share)

        return values


class Gradient(RateFormula):
    """A uniform slope from one side of the field to the other."""

    values: ClassVar[tuple[str, ...]] = ("low", "high")

    family: Literal["gradient"] = "gradient"
    low: Positive
    """Value at the start of the slope and before it."""
    high: Positive
    """Value at the end of the slope and beyond it."""
    angle_deg: float = 0.0
    """Direction from 'low' to 'high' [deg]."""

    def function(self, extent: Extent, rng: np.random.Generator | None = None) -> Truth:
        """See the base class."""
        along, middle = direction(self.angle_deg), extent.centre
        half_width = float(np.abs(along) @ (extent.high - extent.low)) / 2

        def values(xy: Array) -> Array:
            share = np.clip(0.5 + (xy - middle) @ along / (2 * half_width), 0.0, 1.0)
            return np.asarray(self.low + (self.high - self.low) * share)

        return values


class Half(RateFormula):
    """Two uniform halves with a straight, smooth border."""

    values: ClassVar[tuple[str, ...]] = ("low", "high")

    family: Literal["half"] = "half"
    low: Positive
    """Value on the near side of the border."""
    high: Positive
    """Value on the far side of the border."""
    transition_m: Positive = 6.0
    """Width of the transition, which contains three quarters of the change [m]."""
    angle_deg: float = 0.0
    """Direction from 'low' to 'high', across the border [deg]."""
    offset_m: float = 0.0
    """Distance of the border from the middle of the field, in the direction of ``angle_deg`` [m]."""

    def function(self, extent: Extent, rng: np.random.Generator | None = None) -> Truth:
        """See the base class."""
        along, middle = direction(self.angle_deg), extent.centre

        def values(xy: Array) -> Array:
            share = smooth_step((xy - middle) @ along - self.offset_m, self.transition_m)
            return np.asarray(self.low + (self.high - self.low) * share)

        return values


FAMILIES: dict[str, type[RateFormula]] = {
    family.model_fields["family"].default: family
    for family in (
        GaussianField,
        ExponentialField,
        Matern32Field,
        Patches,
        Ridge,
        Gradient,
        Half,
        Halves,
        RoughPatch,
        Strips,
        Texture,
    )
}


def formula(family: str, **parameters: Any) -> RateFormula:
    """A formula by the name of its family.

    :param family: one of ``FAMILIES``
    :param parameters: parameters of the family
    :raises pydantic.ValidationError: (a ValueError) for an unknown family, or a bad or unknown parameter
    """
    return parse_formula({"family": family, **parameters})


def parse_formula(content: Any) -> RateFormula:
    """A formula from the keys and values of a file.

    :raises pydantic.ValidationError: (a ValueError) with the location of every mistake
    """
    if isinstance(content, RateFormula):
        return content
    if not isinstance(content, Mapping):
        raise _refusal((), f"a formula is a block of keys with a 'family', one of: {', '.join(FAMILIES)}")
    name = content.get("family")
    if name is None:
        raise _refusal((), f"the formula has no 'family'; it may be one of: {', '.join(FAMILIES)}")
    family = FAMILIES.get(str(name))
    if family is None:
        raise _refusal(
            ("family",),
            f"unknown family {name!r}; known are {', '.join(FAMILIES)}{did_you_mean(str(name), FAMILIES)}",
        )
    known = family.model_fields
    for key in content:
        if key not in known:
            raise _refusal(
                (str(key),),
                f"the family {name!r} has no parameter {key!r}; it has {', '.join(known)}"
                f"{did_you_mean(str(key), known)}",
            )
    return family.model_validate(dict(content))


Formula = Annotated[RateFormula, BeforeValidator(parse_formula)]


def _refusal(location: tuple[str, ...], message: str) -> ValidationError:
    # The message is passed as a value: PydanticCustomError treats braces in a template as placeholders.
    error = PydanticCustomError("formula", "{message}", {"message": message})
    return ValidationError.from_exception_data("formula", [InitErrorDetails(type=error, loc=location, input=None)])
