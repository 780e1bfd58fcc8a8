# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Families of fields that a formula and a few parameters define.

A formula computes one quantity, the corrected rate [counts/s] or the soil moisture [m^3/m^3], at any position.
Angles count anticlockwise from east. The middle of a field is the middle of its bounding box. ``transition_m`` and
``edge_m`` are widths that contain three quarters of a change.

Random fields come from circulant embedding: Dietrich & Newsam (1997), SIAM Journal on Scientific Computing
18:1088-1107; Wood & Chan (1994), Journal of Computational and Graphical Statistics 3:409-432.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator, Field, model_validator

from soilmoist_ros.foundation import Section, did_you_mean
from soilmoist_ros.mapping import ModelName, correlation_model
from soilmoist_ros.simulation.fields.surrogate_field import GridExtent, RateGrid

Array = NDArray[np.float64]
Truth = Callable[[Array], Array]
Quantity = Literal["rate_cps", "vwc"]
Positive = Annotated[float, Field(gt=0)]
Seed = Annotated[int, Field(ge=0)]

FLOOR = 0.05  # lower limit of random fields as a share of their mean
MAX_VWC = 0.9
NEGLIGIBLE = 1e-6
"""Share of negative eigenvalues that may be cut off; it limits the relative error of the covariances."""
MAX_NODES = 16_000_000


def smooth_step(distance_m: Array, width_m: float) -> Array:
    """Share that rises from 0 to 1 and is 0.5 at distance 0; three quarters of the rise lie within ``width_m``."""
    return np.asarray(0.5 * (1 + np.tanh(distance_m / (width_m / 2))))


def direction(angle_deg: float) -> Array:
    """Unit vector of an angle counted anticlockwise from east, shape (2,)."""
    angle = np.deg2rad(angle_deg)
    return np.array([np.cos(angle), np.sin(angle)])


def random_field(x_m: Array, y_m: Array, model: ModelName, range_m: float, rng: np.random.Generator) -> Array:
    """A Gaussian random field of mean 0 and variance 1 on the nodes of an even grid, shape (ny, nx).

    An FFT yields the eigenvalues of the covariance on a torus that contains the grid. Without negative
    eigenvalues, the field on the nodes has *exactly* the covariance of the model. The torus is enlarged until the
    negative eigenvalues sum to less than 1e-6 of the variance. They are set to 0, which changes every covariance
    by at most 1e-6. Bilinear interpolation between nodes loses variance. With a step of a tenth of the range, the
    mean loss is 1 % with the Gaussian and Matern models and 6 % with the exponential.

    :raises ValueError: if the range is too long for the grid, because the torus would not fit into memory
    """
    steps = [float(axis[1] - axis[0]) if len(axis) > 1 else 1.0 for axis in (y_m, x_m)]
    eigenvalues = _torus_eigenvalues((len(y_m), len(x_m)), steps, model, range_m)
    noise = rng.standard_normal(eigenvalues.shape) + 1j * rng.standard_normal(eigenvalues.shape)
    spectrum = np.fft.fft2(np.sqrt(eigenvalues / eigenvalues.size) * noise)
    return np.ascontiguousarray(spectrum.real[: len(y_m), : len(x_m)])


def _torus_eigenvalues(shape: tuple[int, int], steps: list[float], model: str, range_m: float) -> Array:
    """Eigenvalues of the covariance on the smallest torus without noticeably negative eigenvalues."""
    from scipy.fft import next_fast_len

    least = [2 * (count - 1) for count in shape]
    reach = [correlation_model(model).practical * range_m / step for step in steps]
    for enlargement in (0.0, 2.0, 4.0, 6.0, 9.0, 13.0):
        wanted = np.maximum(least, np.add(shape, np.multiply(enlargement, reach)))
        size = [next_fast_len(max(2, int(np.ceil(count)))) for count in wanted]
        if np.prod(size) > MAX_NODES:
            break
        lags = [np.minimum(np.arange(n), n - np.arange(n)) * step for n, step in zip(size, steps, strict=True)]
        square = (lags[0][:, None] ** 2 + lags[1][None, :] ** 2) / range_m**2
        eigenvalues = np.fft.fft2(correlation_model(model).correlation(square)).real
        if -eigenvalues[eigenvalues < 0].sum() <= NEGLIGIBLE * eigenvalues.size:
            return np.maximum(eigenvalues, 0.0)
    raise ValueError(
        f"no random field with the {model} model of range {range_m:g} m on {shape[0]} x {shape[1]} nodes "
        f"{steps[1]:g} m apart: use a shorter range or larger cells"
    )


class RateFormula(Section):
    """Base class of all families."""

    values: ClassVar[tuple[str, ...]]  # names of the parameters in units of the quantity

    family: str
    quantity: Quantity = "rate_cps"  # corrected rate [counts/s] or soil moisture [m^3/m^3]

    @model_validator(mode="after")
    def _possible(self) -> RateFormula:
        for name in self.values:
            if self.quantity == "vwc" and getattr(self, name) > MAX_VWC:
                raise ValueError(f"{name!r} is a moisture in m3/m3 and at most {MAX_VWC}, not a percentage")
        return self

    def function(self, extent: GridExtent, rng: np.random.Generator | None = None) -> Truth:
        """Function of positions, shape (n, 2) [m], that returns values, shape (n,); ``rng`` replaces the seed."""
        raise NotImplementedError


class GaussianField(RateFormula):
    """Base class of Gaussian random fields.

    Values below 5 % of the mean are raised to 5 % of the mean. With a standard deviation of at most a quarter of
    the mean, this limit affects fewer than one position in 10,000.
    """

    values: ClassVar[tuple[str, ...]] = ("mean",)

    mean: Positive  # mean of the quantity
    sd: Positive  # its standard deviation, that of rough ground if there is flat; at most a quarter of the mean
    seed: Seed = 1  # seed of the values, and of the place or direction of rough ground where it is not given

    @model_validator(mode="after")
    def _stays_positive(self) -> GaussianField:
        if self.sd > self.mean / 4:
            raise ValueError(f"'sd' must be at most a quarter of 'mean' ({self.mean / 4:g}) to stay positive")
        return self


class RandomField(GaussianField):
    """A stationary random field: infinitely smooth (Gaussian), rough (exponential), or smooth (Matern 3/2)."""

    family: Literal["gaussian_field", "exponential", "matern32"]
    range_m: Positive = 15.0
    """Range parameter of the correlation [m]. The variogram reaches 95 % of the variance at a multiple of this
    distance: 1.7 (Gaussian), 3 (exponential) or 2.7 (Matern 3/2)."""

    @property
    def model(self) -> ModelName:
        """Correlation model."""
        return "gaussian" if self.family == "gaussian_field" else self.family

    def function(self, extent: GridExtent, rng: np.random.Generator | None = None) -> Truth:
        """See the base class."""
        x, y = extent.axes()
        noise = random_field(x, y, self.model, self.range_m, rng or np.random.default_rng(self.seed))
        return RateGrid(x, y, np.maximum(self.mean + self.sd * noise, FLOOR * self.mean))


class UnevenField(GaussianField):
    """Base class of random fields of uneven roughness."""

    flat_sd: Annotated[float, Field(ge=0)] = 0.0  # standard deviation on flat ground, at most ``sd``
    model: ModelName = "matern32"  # variogram model of rough and flat ground
    range_m: Positive = 10.0  # range parameter on rough ground [m], as in :class:`.RandomField`
    flat_range_m: Positive | None = None  # range parameter on flat ground [m]; by default that of rough ground
    transition_m: Positive = 4.0  # width of the transition from rough to flat ground [m]

    @model_validator(mode="after")
    def _is_flatter(self) -> UnevenField:
        if self.flat_sd > self.sd:
            raise ValueError(f"'flat_sd' must be at most 'sd' ({self.sd:g}), the variation of the rough ground")
        return self

    def function(self, extent: GridExtent, rng: np.random.Generator | None = None) -> Truth:
        """See the base class."""
        rng = rng or np.random.default_rng(self.seed)
        x, y = extent.axes()
        places = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        share = self._rough_share(places, extent, rng).reshape(len(y), len(x))
        rough, flat = (
            random_field(x, y, self.model, range_m, rng)
            for range_m in (self.range_m, self.flat_range_m or self.range_m)
        )
        values = self.mean + share * self.sd * rough + (1 - share) * self.flat_sd * flat
        return RateGrid(x, y, np.maximum(values, FLOOR * self.mean))

    def _rough_share(self, xy: Array, extent: GridExtent, rng: np.random.Generator) -> Array:
        """Share of rough ground at places of shape (n, 2) [m]: from 0, flat, to 1, rough; shape (n,)."""
        raise NotImplementedError


class Halves(UnevenField):
    """One rough and one flat half with a straight border through the middle of the field."""

    family: Literal["halves"] = "halves"
    angle_deg: float | None = None  # direction from the flat to the rough half [deg]; by default from the seed

    def _rough_share(self, xy: Array, extent: GridExtent, rng: np.random.Generator) -> Array:
        across = direction(_angle(self.angle_deg, rng))
        return smooth_step((xy - extent.centre) @ across, self.transition_m)


class RoughPatch(UnevenField):
    """One round rough patch in a flat field, at a place drawn from the seed."""

    family: Literal["rough_patch"] = "rough_patch"
    area: Annotated[float, Field(gt=0, le=0.5)] = 0.1  # share of the field's bounding box [-]

    def _rough_share(self, xy: Array, extent: GridExtent, rng: np.random.Generator) -> Array:
        size = extent.high - extent.low
        radius = np.sqrt(self.area * size.prod() / np.pi)
        margin = np.minimum(radius, 0.5 * size)
        centre = rng.uniform(extent.low + margin, extent.high - margin)
        return smooth_step(radius - np.hypot(*(xy - centre).T), self.transition_m)


class Strips(UnevenField):
    """Parallel strips, rough and flat in turn."""

    family: Literal["strips"] = "strips"
    width_m: Positive = 12.0  # width of a strip [m]
    angle_deg: float | None = None  # direction in which the strips run [deg]; by default from the seed

    def _rough_share(self, xy: Array, extent: GridExtent, rng: np.random.Generator) -> Array:
        across = direction(_angle(self.angle_deg, rng) - 90)
        first = rng.uniform(0, 2 * self.width_m)
        position = ((xy - extent.centre) @ across - first) % (2 * self.width_m)
        return smooth_step(self.width_m / 2 - np.abs(position - self.width_m), self.transition_m)


def _angle(given_deg: float | None, rng: np.random.Generator) -> float:
    """The angle given, or one drawn from all directions [deg]."""
    return float(rng.uniform(0, 360)) if given_deg is None else given_deg


class Texture(RateFormula):
    """Zones and finer variation between two limits; every value between them covers the same area on average.

    The value is ``low + (high - low) Phi(z)`` with ``z = sqrt(1 - fine) zones + sqrt(fine) inside``: two
    independent Gaussian random fields of variance 1 (Matern 3/2), and the normal distribution function Phi.
    """

    values: ClassVar[tuple[str, ...]] = ("low", "high")

    family: Literal["texture"] = "texture"
    low: Positive  # value of the purest sand (moisture), or of the heaviest clay (rate)
    high: Positive  # value at the other end, greater than ``low``
    range_m: Positive = 40.0  # range parameter of the zones [m]; a zone is about twice as wide
    fine: Annotated[float, Field(ge=0, le=1)] = 0.1  # share of the variance inside zones
    fine_range_m: Positive = 8.0  # range parameter of the variation inside zones [m]
    seed: Seed = 1  # fields of one seed, boundary and cell size share their zones

    @model_validator(mode="after")
    def _low_is_below_high(self) -> Texture:
        if self.low >= self.high:
            raise ValueError(f"'low' must be below 'high' ({self.high:g})")
        return self

    def function(self, extent: GridExtent, rng: np.random.Generator | None = None) -> Truth:
        """See the base class."""
        from scipy.special import ndtr

        rng = rng or np.random.default_rng(self.seed)
        x, y = extent.axes()
        zones, inside = (
            random_field(x, y, "matern32", range_m, rng) for range_m in (self.range_m, self.fine_range_m)
        )
        share = ndtr(np.sqrt(1 - self.fine) * zones + np.sqrt(self.fine) * inside)
        return RateGrid(x, y, self.low + (self.high - self.low) * share)


class Shape(RateFormula):
    """Base class of fields that lie between two values by a smooth share; ``values`` names them."""

    def function(self, extent: GridExtent, rng: np.random.Generator | None = None) -> Truth:
        """See the base class."""
        zero, one = (getattr(self, name) for name in self.values)
        share = self._share(extent, rng)
        return lambda xy: np.asarray(zero + (one - zero) * share(xy))

    def _share(self, extent: GridExtent, rng: np.random.Generator | None) -> Truth:
        """Function that returns the share of the second value, 0..1, shape (n,)."""
        raise NotImplementedError


class Patches(Shape):
    """Round patches at random positions on a uniform background."""

    values: ClassVar[tuple[str, ...]] = ("background", "patch")

    family: Literal["patches"] = "patches"
    background: Positive  # value between the patches
    patch: Positive  # value inside a patch
    count: Annotated[int, Field(ge=1, le=1000)] = 6  # number of patches; they may overlap
    radius_m: Positive = 8.0  # mean radius [m]; each radius is drawn between 0.6 and 1.4 times the mean
    edge_m: Positive = 4.0  # width of the edge of a patch [m]
    seed: Seed = 1  # seed of positions and radii

    def _share(self, extent: GridExtent, rng: np.random.Generator | None) -> Truth:
        rng = rng or np.random.default_rng(self.seed)
        centres = rng.uniform(extent.low, extent.high, (self.count, 2))
        radii = self.radius_m * rng.uniform(0.6, 1.4, self.count)

        def share(xy: Array) -> Array:
            distance = np.hypot(*(xy[:, None, :] - centres).transpose(2, 0, 1))
            return np.asarray(smooth_step(radii - distance, self.edge_m).max(axis=1))

        return share


class Ridge(Shape):
    """A straight ridge (or trench) of Gaussian cross-section."""

    values: ClassVar[tuple[str, ...]] = ("background", "crest")

    family: Literal["ridge"] = "ridge"
    background: Positive  # value far from the ridge
    crest: Positive  # value along the middle of the ridge
    width_m: Positive = 10.0  # standard deviation of the cross-section [m]
    angle_deg: float = 90.0  # direction in which the ridge runs [deg]
    offset_m: float = 0.0  # distance of the ridge from the field's middle, to the right of its direction [m]

    def _share(self, extent: GridExtent, rng: np.random.Generator | None) -> Truth:
        across, middle = direction(self.angle_deg - 90), extent.centre
        return lambda xy: np.exp(-0.5 * (((xy - middle) @ across - self.offset_m) / self.width_m) ** 2)


FAMILIES: dict[str, type[RateFormula]] = {
    **dict.fromkeys(("gaussian_field", "exponential", "matern32"), RandomField), "patches": Patches,
    "ridge": Ridge, "halves": Halves, "rough_patch": RoughPatch, "strips": Strips, "texture": Texture,
}  # fmt: skip


def formula(family: str, **parameters: Any) -> RateFormula:
    """A formula from the name of its family and its parameters.

    :raises ValueError: for an unknown family, or a bad or unknown parameter
    """
    return parse_formula({"family": family, **parameters})


def parse_formula(content: Any) -> RateFormula:
    """A formula from the keys and values of a file.

    :raises ValueError: with every mistake
    """
    if isinstance(content, RateFormula):
        return content
    name = content.get("family") if isinstance(content, Mapping) else None
    if name is None:
        raise ValueError(f"a formula is a block of keys with a 'family', one of: {', '.join(FAMILIES)}")
    family = FAMILIES.get(str(name))
    if family is None:
        known = f"known are {', '.join(FAMILIES)}{did_you_mean(str(name), FAMILIES)}"
        raise ValueError(f"unknown family {name!r}; {known}")
    keys = family.model_fields
    if unknown := [key for key in content if key not in keys]:
        which = f"{unknown[0]!r}; it has {', '.join(keys)}{did_you_mean(str(unknown[0]), keys)}"
        raise ValueError(f"the family {name!r} has no parameter {which}")
    return family.model_validate(dict(content))


Formula = Annotated[RateFormula, BeforeValidator(parse_formula)]
