"""The soil map: rate and soil moisture with their uncertainty over a field, and what they came from."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.mapping.field_grid import FieldGrid
from soilmoist_ros.mapping.poisson_kriging import PoissonKriging
from soilmoist_ros.mapping.samples import Samples
from soilmoist_ros.mapping.tiled_kriging import Accuracy, Compute, TiledKriging
from soilmoist_ros.mapping.variogram import Variogram
from soilmoist_ros.mapping.variogram_fit import VariogramFit
from soilmoist_ros.sensing.moisture import CalibrationCurve

Array = NDArray[np.float64]

MOST_EXACT_SAMPLES = 2000
"""Up to so many samples a map is exact; beyond, each tile of it is made of the samples around."""


class Bands(NamedTuple):
    """The four bands of a map, of one shape.

    :param rate: corrected count rate [counts/s]
    :param rate_sd: its kriging standard deviation [counts/s]
    :param vwc: volumetric water content [m^3/m^3]; NaN without a curve, or where the rate has none
    :param vwc_sd: its standard deviation, third order (Jakobi et al. 2020) [m^3/m^3]; NaN likewise
    """

    rate: Array
    rate_sd: Array
    vwc: Array
    vwc_sd: Array


@dataclass(frozen=True, eq=False)
class SoilMap:
    """A map of one field; the bands have shape (ny, nx) and are NaN outside the field.

    :param grid: the field's grid
    :param rate: corrected count rate [counts/s]
    :param rate_sd: its kriging standard deviation [counts/s]
    :param vwc: volumetric water content [m^3/m^3]; all NaN if ``curve`` is ``None``
    :param vwc_sd: its standard deviation [m^3/m^3]; likewise
    :param samples: the samples behind the map, as given
    :param variogram: the variogram used
    :param fit: how it was fitted; ``None`` if it was given
    :param mean_rate: mean rate m* in the noise of the samples [counts/s]
    :param curve: calibration, ``None`` if the map is of the rate only
    :param kriging: the fitted kriging, for estimates at other places
    :param undefined_vwc_cells: inside cells whose rate is too low for any soil moisture (rate <= A1 N0);
        0 without a curve
    :param clipped_variances: inside cells whose variance came out negative (rounding) and was set to 0
    """

    grid: FieldGrid
    rate: Array
    rate_sd: Array
    vwc: Array
    vwc_sd: Array
    samples: Samples
    variogram: Variogram
    fit: VariogramFit | None
    mean_rate: float
    curve: CalibrationCurve | None
    kriging: PoissonKriging | TiledKriging
    undefined_vwc_cells: int
    clipped_variances: int

    @property
    def bands(self) -> Bands:
        """The four rasters together."""
        return Bands(self.rate, self.rate_sd, self.vwc, self.vwc_sd)

    @property
    def unknown_rate_sd(self) -> float:
        """Standard deviation that the model gives the rate far from all samples, about its mean [counts/s]."""
        sill = self.variogram.sill if self.kriging.keep_nugget else self.variogram.structured_sill
        return math.sqrt(sill)

    @property
    def accuracy(self) -> Accuracy | None:
        """How far a map made tile by tile is from the exact one; ``None`` if it is exact."""
        return self.kriging.accuracy if isinstance(self.kriging, TiledKriging) else None

    def evaluate(self, xy: ArrayLike) -> Bands:
        """The four bands at any points, inside the field or not.

        :param xy: points, shape (g, 2) [m]
        :returns: bands of shape (g,)
        """
        return _bands(*self.kriging.predict(xy), self.curve)


def make_soil_map(
    samples: Samples,
    grid: FieldGrid,
    variogram: Variogram | VariogramFit,
    curve: CalibrationCurve | None = None,
    keep_nugget: bool = True,
    progress: Callable[[float], None] | None = None,
    most_exact: int = MOST_EXACT_SAMPLES,
    compute: Compute = map,
) -> SoilMap:
    """Krige the samples onto the cells of a field: exactly, or tile by tile if they are very many.

    :param samples: at least one
    :param grid: the field
    :param variogram: a variogram, or the result of a fit
    :param curve: calibration that turns the rate into soil moisture
    :param keep_nugget: as :class:`~soilmoist_ros.mapping.poisson_kriging.PoissonKriging`
    :param progress: called with the fraction done, from above 0 to 1
    :param most_exact: number of samples beyond which it is
        :class:`~soilmoist_ros.mapping.tiled_kriging.TiledKriging` that makes the map
    :param compute: computes the tiles, as there
    :raises ValueError: without samples
    """
    fit = variogram if isinstance(variogram, VariogramFit) else None
    model = variogram.variogram if isinstance(variogram, VariogramFit) else variogram
    kriging: PoissonKriging | TiledKriging
    if len(samples) <= most_exact:
        kriging = PoissonKriging(model, keep_nugget)
    else:
        kriging = TiledKriging(model, keep_nugget, compute=compute)
    kriging.fit(samples.xy, samples.counts, samples.exposure_s, samples.spread)
    bands = _bands(*kriging.predict_grid(grid.x_m, grid.y_m, grid.mask, progress), curve)
    undefined = 0 if curve is None else int(np.count_nonzero(~curve.valid(bands.rate[grid.mask])))
    return SoilMap(
        grid,
        *bands,
        samples=samples,
        variogram=model,
        fit=fit,
        mean_rate=kriging.noise_mean_rate,
        curve=curve,
        kriging=kriging,
        undefined_vwc_cells=undefined,
        clipped_variances=kriging.clipped_variances,
    )


def _bands(rate: Array, variance: Array, curve: CalibrationCurve | None) -> Bands:
    rate_sd = np.sqrt(variance)
    if curve is None:
        return Bands(rate, rate_sd, np.full(rate.shape, np.nan), np.full(rate.shape, np.nan))
    return Bands(rate, rate_sd, curve.vwc(rate), curve.vwc_sd(rate, rate_sd, order=3))
