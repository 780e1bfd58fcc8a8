"""Several properties of one field: how much the map of each leaves to be explained, and what that is worth.

Each property p has a map of its own, of counts of its own. A planner that weighs them lowers::

    sum_p w_p IV_p / V_p,    V_p = sum_g omega_g (1 - mean correlation between the cells) sill_p

IV_p is the integrated variance of the smooth rate, V_p what it is where nothing but the mean over the field is
known (the dispersion variance, Chiles & Delfiner 2012, Geostatistics, section 2.8): each IV_p / V_p is the share
of the variation over the field that the map of the property does not explain yet, whatever its unit. The sill
alone would not do: of a field with a trend only the ratio of sill and range is known well.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.mapping.field_map import FieldMap
from soilmoist_ros.mapping.variogram.model import Variogram

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Property:
    """A property that is mapped beside the first.

    :param field_map: its map, on the cells of the first's
    :param weight: what a share of its variation is worth, that of the first being 1; 0: it does not matter
    """

    field_map: FieldMap
    weight: float = 1.0


def variation(variogram: Variogram, cells_xy: Array) -> float:
    """Variance of the smooth rate over cells that a variogram lets expect [(counts/s)^2].

    :param variogram: of the rate
    :param cells_xy: places of the cells, shape (g, 2) [m]
    """
    from scipy.spatial.distance import cdist

    scaled = variogram.scaled(cells_xy)
    correlation = variogram.correlation_of_square(cdist(scaled, scaled, "sqeuclidean"))
    return max(variogram.structured_sill * (1 - float(correlation.mean())), 0.0)
