"""The map of a mission under way: samples come in, the variogram is fitted anew, the map follows."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.mapping.grid import FieldGrid
from soilmoist_ros.mapping.kriging.poisson_kriging import PoissonKriging
from soilmoist_ros.mapping.samples.samples import NO_SAMPLES, Samples
from soilmoist_ros.mapping.soil_map import SoilMap, make_soil_map
from soilmoist_ros.mapping.variogram.fit import FitMethod, VariogramFit, estimate_variogram
from soilmoist_ros.mapping.variogram.model import ModelName
from soilmoist_ros.sensing.moisture.curve import CalibrationCurve

Array = NDArray[np.float64]


class LiveMap:
    """Samples so far, and the map of the last :meth:`update` or :meth:`take`.

    :param grid: the field
    :param model: variogram model
    :param method: how the variogram is fitted
    :param keep_nugget: as :class:`PoissonKriging`

    Attributes
    ----------
    fit : VariogramFit | None
        the variogram of the last map
    kriging : PoissonKriging | None
        the kriging of the last map
    rate, variance : NDArray
        rate [counts/s] and kriging variance [(counts/s)^2] of ``grid.cells``, shape (g,); NaN before the first
        map
    """

    def __init__(
        self,
        grid: FieldGrid,
        model: ModelName = "matern32",
        method: FitMethod = "reml",
        keep_nugget: bool = True,
    ) -> None:
        self.grid = grid
        self.model = model
        self.method = method
        self.keep_nugget = keep_nugget
        self.samples = NO_SAMPLES
        self.fit: VariogramFit | None = None
        self.kriging: PoissonKriging | None = None
        self.rate: Array = np.full(np.count_nonzero(grid.mask), np.nan)
        self.variance: Array = self.rate.copy()

    def add(self, xy: tuple[float, float], raw_counts: float, effective_exposure_s: float) -> None:
        """Take a sample; the map does not change before :meth:`update`.

        :param xy: place [m]
        :param raw_counts: raw counts, a whole number
        :param effective_exposure_s: effective exposure [s], > 0
        :raises ValueError: if a value is out of range; the samples stay as they were
        """
        old = self.samples
        self.samples = Samples(
            np.concatenate([old.xy, [xy]]),
            np.append(old.counts, raw_counts),
            np.append(old.exposure_s, effective_exposure_s),
            np.concatenate([old.spread, np.zeros((1, 3))]),
        )

    @property
    def ready(self) -> bool:
        """Whether there are samples enough for a map: at two places for soft-L1, at one for REML."""
        if self.method == "soft_l1":
            return bool((self.samples.xy != self.samples.xy[:1]).any())
        return len(self.samples) > 0

    def update(self) -> None:
        """Fit the variogram and krige the map from all samples.

        :raises ValueError: if the map is not :attr:`ready`
        """
        samples = self.samples
        fit = estimate_variogram(
            samples.xy,
            samples.counts,
            samples.exposure_s,
            self.model,
            self.method,
            extent_m=self.grid.extent_m,
            spread=samples.spread,
        )
        self.take(samples, fit)

    def take(self, samples: Samples, fit: VariogramFit) -> None:
        """Krige the map of samples merged elsewhere, with a variogram fitted elsewhere.

        :param samples: all samples, in place of those so far; at least one
        :param fit: their variogram; also its model is used as it is
        :raises ValueError: if there is no sample; the map stays as it was
        :raises IllConditionedError: if the matrix cannot be factored; the map stays as it was
        """
        grid = self.grid
        kriging = PoissonKriging(fit.variogram, self.keep_nugget, fit.mean_rate or None)
        kriging.fit(samples.xy, samples.counts, samples.exposure_s, samples.spread)
        rate, variance = kriging.predict_grid(grid.x_m, grid.y_m, grid.mask)
        self.samples, self.fit, self.kriging = samples, fit, kriging
        self.rate, self.variance = rate[grid.mask], variance[grid.mask]

    def soil_map(self, curve: CalibrationCurve | None = None) -> SoilMap | None:
        """The last map with all its bands, ``None`` before the first."""
        if self.fit is None:
            return None
        return make_soil_map(self.samples, self.grid, self.fit, curve, self.keep_nugget)
