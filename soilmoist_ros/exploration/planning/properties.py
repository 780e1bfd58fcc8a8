# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Properties of a field, and the normalised kriging variance that a planner lowers for all of them.

Each property p has its own counts and its own map. The planner lowers::

    sum_p w_p IV_p / V_p,    V_p = sum_g omega_g (1 - mean correlation between the cells) sill_p

IV_p is the integrated variance of the smooth rate. V_p is its value when only the mean over the field is known
(the dispersion variance, Chiles & Delfiner 2012, Geostatistics, section 2.8). IV_p / V_p has no unit. V_p is not
the sill: the data of a field with a trend determine only the ratio of sill and range well.

An *aim* says how good a map must be. It is a figure of the map's variances, or of variances and rates, so its
value after any plan is known in advance. A tour for an aim is the shortest one after which it should be met.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.exploration.planning.decision import Thresholds, probability_of_zone
from soilmoist_ros.foundation import InputError, did_you_mean, squared_distances
from soilmoist_ros.mapping import FieldMap, Variogram
from soilmoist_ros.sensing import CountRecord, MoistureCurve

Array = NDArray[np.float64]

MIN_RATE_CPS = 1e-3
"""Lower limit of predicted rates [counts/s]: kriging may undershoot."""
_WORD: Final = "[A-Za-z_][A-Za-z0-9_]*"
_NAMESPACE: Final = re.compile(rf"/?{_WORD}(/{_WORD})*/*")


@dataclass(eq=False)
class Property:
    """A mapped property of the field, as the planner sees it now.

    :param curve: calibration, to lower the variance of the moisture map instead of the rate map
    """

    field_map: FieldMap  # its map; all properties have the same grid
    weight: float = 1.0  # weight of its normalised kriging variance, relative to the other properties; 0: ignored
    factor: float = 1.0  # product of the correction factors of its sensor now, ``raw rate = rate / factor`` [-]
    curve: MoistureCurve | None = None
    name: str = ""  # namespace of its mapper, empty for the mapper of the robot
    thresholds: Thresholds | None = None  # those of the decision that its map is for, if it is for one


def slope2(of: Property, rate: Array) -> Array:
    """Factor from the variance of a rate [counts/s] to that of the map's unit: moisture, or share of the mean."""
    if of.curve is not None:
        return of.curve.weight(rate)
    return np.full(len(rate), 1 / max(float(rate.mean()), MIN_RATE_CPS) ** 2)


def correction_factor(record: CountRecord) -> float:
    """Product of the correction factors of a record: exposure divided by effective exposure [-].

    >>> correction_factor(CountRecord(0.0, 0.0, 0.0, 0.0, 40, exposure_s=10.0, effective_exposure_s=8.0))
    1.25
    """
    return record.exposure_s / record.effective_exposure_s


def variation(variogram: Variogram, cells_xy: Array) -> float:
    """Variance of the smooth rate over cells, as expected from a variogram [(counts/s)^2]."""
    scaled = variogram.scaled(cells_xy)
    correlation = variogram.correlation_of_square(squared_distances(scaled, scaled))
    return max(variogram.structured_sill * (1 - float(correlation.mean())), 0.0)


def property_weights(texts: Iterable[str]) -> dict[str, float]:
    """Namespaces of further properties, each with its weight.

    :param texts: ``NAMESPACE`` or ``NAMESPACE:WEIGHT``; names without a leading / are below the robot's
    :raises InputError: if a text has no valid namespace, or its weight is not a number from 0
    """
    found = {}
    for text in texts:
        name, colon, number = text.partition(":")
        try:
            weight = float(number) if colon else 1.0
        except ValueError:
            weight = math.nan
        if not _NAMESPACE.fullmatch(name) or not (math.isfinite(weight) and weight >= 0):
            remedy = "give words of letters, digits and _ with / between, such as /compaction or /compaction:0.5"
            raise InputError(f"properties: {text!r} is not a namespace with a weight from 0", remedy)
        found[name.rstrip("/")] = weight
    return found


def property_name(field: str) -> str:
    """Name of the property that a surrogate field simulates."""
    path = Path(field)
    text = path.stem if path.suffix in (".yaml", ".yml") else path.name
    name = re.sub("[^A-Za-z0-9]+", "_", text).strip("_")
    return name if re.fullmatch(_WORD, name) else f"property_{name}".rstrip("_")


# Aims -----------------------------------------------------------------------------------------------------------

KINDS = {"sd": "mean standard deviation", "p95-sd": "95 % of the field", "zone": "zones"}
UNITS = {"": "", "m3/m3": "vwc", "vwc": "vwc", "rate": "rate"}
MAX_SD = 0.5
ZONES = 3  # a third of the area each, from dry to wet, as in the report
QUANTILE = 0.95
_LEVELS, _LEVEL_WEIGHTS = np.polynomial.hermite_e.hermegauss(9)
_LEVEL_WEIGHTS = _LEVEL_WEIGHTS / _LEVEL_WEIGHTS.sum()
_EXAMPLES = "write for example 'p95-sd=0.02', 'sd=2%', 'sd=0.02 m3/m3', 'sd=5% rate' or 'zone=0.85'"


@dataclass(frozen=True, slots=True)
class Aim:
    """Quality that a map must have.

    :param kind: ``sd``: root of the mean variance; ``p95-sd``: standard deviation that 95 % of the field do not
        exceed; ``zone``: mean probability that a place is in the third of the field, from dry to wet, to which the
        map assigns it
    :param value: m^3/m^3, or share of the mean rate [-]; a probability for ``zone``
    :param of: ``vwc``, ``rate``, or empty: the moisture where the sensor is calibrated, else the rate
    """

    kind: str
    value: float
    of: str = ""

    @classmethod
    def parse(cls, text: str) -> Aim:
        """Read ``KIND=VALUE``, with ``%`` or a unit after the value.

        >>> Aim.parse("p95-sd=2%")
        Aim(kind='p95-sd', value=0.02, of='')
        >>> str(Aim.parse("sd = 0.02 m3/m3"))
        'sd=0.02 m3/m3'

        :raises InputError: if the text is not an aim; the message says how to write one
        """
        plain = text.lower().replace("³", "3").replace("m^3", "m3").strip()
        found = re.fullmatch(r"([a-z0-9-]+)\s*=\s*([-+.0-9e]+)\s*(%?)\s*([a-z0-9/]*)", plain)
        if found is None:
            point = f"write a decimal point: {text.replace(',', '.')}" if "," in text else _EXAMPLES
            raise InputError(f"{text!r} is not an aim", point)
        kind, number, percent, unit = found.groups()
        if kind not in KINDS:
            raise InputError(
                f"there is no aim {kind!r}", f"use one of: {', '.join(KINDS)}{did_you_mean(kind, KINDS)}"
            )
        try:
            value = float(number) / (100 if percent else 1)
        except ValueError:
            value = math.nan
        if unit not in UNITS or (unit and (kind == "zone" or (percent and unit == "m3/m3"))):
            raise InputError(f"the unit {unit!r} of {text!r} is unknown or does not fit", _EXAMPLES)
        low, high = (1 / ZONES, 1.0) if kind == "zone" else (0.0, MAX_SD)
        if not low < value < high:
            meant = not percent and value >= 1 and low < value / 100 < high
            hint = f"{text!r} is not in percent: write {kind}={value:g}%" if meant else _EXAMPLES
            raise InputError(f"the aim {text!r} is not between {low:.3g} and {high:g}", hint)
        return cls(kind, value, UNITS[unit])

    def __str__(self) -> str:
        unit = {"vwc": " m3/m3", "rate": " rate"}.get(self.of, "")
        return f"{self.kind}={self.value:g}{unit}"

    def wants_moisture(self, target: str, calibrated: bool) -> bool:
        """True if the map of the moisture is meant; ``target`` is the mission's.

        :raises InputError: if the moisture is demanded without a calibration
        """
        if self.of == "vwc" and not calibrated:
            raise InputError(
                f"the aim {self} needs a calibration", "give a calibrated site, or an aim such as sd=5% rate"
            )
        if self.of == "rate" or not calibrated:
            return False
        return self.of == "vwc" or self.kind != "zone" or target != "rate"

    def figure(self, rate: Array, variance: Array, slope2: Array, later: Array | None = None) -> float:
        """Value that is compared with :attr:`value`, now or expected after further counts.

        :param rate: rate at each cell, shape (g,) [counts/s]
        :param variance: variance of each cell now, shape (g,) [(counts/s)^2]
        :param slope2: factor from it to the variance in the aim's unit, shape (g,)
        :param later: variance of each cell after further counts; ``None`` for now
        """
        left = variance if later is None else np.minimum(later, variance)
        if self.kind == "zone":
            return zones_right(rate, variance, left)
        squares = np.maximum(slope2 * left, 0.0)
        return math.sqrt(float(squares.mean() if self.kind == "sd" else np.quantile(squares, QUANTILE)))

    def met(self, figure: float) -> bool:
        """True if a figure is good enough."""
        return figure >= self.value if self.kind == "zone" else figure <= self.value


def zones_right(rate: Array, variance: Array, later: Array) -> float:
    """Mean probability that a cell is in the third of the field in which the map will put it.

    The rate to be mapped is normal about the present one with the variance that is removed, and the true rate is
    normal about it with the rest.
    """
    limits = np.quantile(rate, np.arange(1, ZONES) / ZONES)
    mapped = rate[:, None] + np.sqrt(np.maximum(variance - later, 0.0))[:, None] * _LEVELS
    return float((probability_of_zone(mapped, later[:, None], limits) @ _LEVEL_WEIGHTS).mean())


@dataclass(frozen=True, eq=False)
class AimedMap:
    """An aim on the map as it is, for planning; arrays are over the cells of a planning model."""

    aim: Aim
    rate: Array  # [counts/s], shape (g,)
    variance: Array  # nugget included [(counts/s)^2], shape (g,)
    slope2: Array  # factor to the variance in the aim's unit

    def is_met_after(self, fall: Array, slack: float = 0.0) -> bool:
        """True if the aim is expected to be met, but for a slack, after a fall of the variances [(counts/s)^2]."""
        figure = self.aim.figure(self.rate, self.variance, self.slope2, self.variance - fall)
        if self.aim.kind == "zone":
            return 1 - figure <= (1 - self.aim.value) * (1 + slack)
        return figure <= self.aim.value * (1 + slack)
