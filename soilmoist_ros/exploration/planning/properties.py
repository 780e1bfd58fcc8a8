"""Several properties of one field: how much the map of each leaves to be explained, and what that is worth.

Each property p has its own counts and its own map. A planner that weighs them lowers::

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
from soilmoist_ros.sensing.moisture.curve import CalibrationCurve
from soilmoist_ros.sensing.records import CountRecord

Array = NDArray[np.float64]


@dataclass(eq=False)
class Property:
    """A property of the field that is mapped, as the planner sees it now.

    :param field_map: its map; all properties are mapped on the same grid
    :param weight: what a share of its variation is worth, compared with the weights of the others; 0: nothing
    :param factor: product of the correction factors of its sensor now, ``raw rate = rate / factor`` [-]
    :param curve: calibration, if the map of the moisture is to be good rather than that of the rate
    :param name: namespace of its mapper, empty for the robot's own
    """

    field_map: FieldMap
    weight: float = 1.0
    factor: float = 1.0
    curve: CalibrationCurve | None = None
    name: str = ""


def correction_factor(record: CountRecord) -> float:
    """Product of the correction factors of a record: its exposure divided by the effective one [-].

    >>> correction_factor(CountRecord(0.0, 0.0, 0.0, 0.0, 40, exposure_s=10.0, effective_exposure_s=8.0))
    1.25
    """
    return record.exposure_s / record.effective_exposure_s


def variation(variogram: Variogram, cells_xy: Array) -> float:
    """Variance of the smooth rate over cells that a variogram lets expect [(counts/s)^2].

    :param variogram: of the rate
    :param cells_xy: places of the cells, shape (g, 2) [m]
    """
    from scipy.spatial.distance import cdist

    scaled = variogram.scaled(cells_xy)
    correlation = variogram.correlation_of_square(cdist(scaled, scaled, "sqeuclidean"))
    return max(variogram.structured_sill * (1 - float(correlation.mean())), 0.0)
