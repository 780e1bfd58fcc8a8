# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Decisions by thresholds, and the expected loss that a measurement saves.

Thresholds divide a field into zones. A place in the wrong zone costs its distance from each threshold between. The
rate of a place is normal with mean m and standard deviation s. With the unit normal loss
``psi(u) = phi(u) - u Phi(-u)``, the better side of a threshold T still costs ``s psi(|m - T| / s)`` on average
(Raiffa & Schlaifer 1961, Applied Statistical Decision Theory). Counts that lower the variance by v will move the
mean by a normal amount of variance v, so they save ``sqrt(v) psi(|m - T| / sqrt(v))``. Both are exact, and they
add up over places and thresholds.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import InputError
from soilmoist_ros.sensing import MoistureCurve, soil_limits

Array = NDArray[np.float64]

EXPLORING = 0.25
"""Share of the mission time in which the whole map becomes good: counts must first say how the field varies, and
where the thresholds lie."""
OF_DOSE = "dose"
"""Word for the thresholds between the doses of a site file."""
PRESENT = 0.01  # share of the field that a threshold must have on either side to be one of the field
_NODES = 16  # equally probable values of a mean that further counts will move
_TINY = 1e-12


def parse_thresholds(text: str) -> tuple[float, ...]:
    """Read thresholds, rising; one that is repeated is kept, as doses may be.

    >>> parse_thresholds("0.25, 15 %")
    (0.15, 0.25)

    :raises InputError: if there are none, or one is not a positive number
    """
    words = re.split(r"[,;\s]+", re.sub(r"\s+%", "%", text.strip()))
    try:
        values = sorted(float(one.removesuffix("%")) / (100 if one.endswith("%") else 1) for one in words)
    except ValueError:
        values = []
    if not values or not all(math.isfinite(one) and one > 0 for one in values):
        how = "give numbers above 0, such as 0.15 or 0.15,0.25, with a point before the decimals"
        raise InputError(f"{text!r} is not a list of thresholds", how)
    return tuple(values)


def check_target(target: str, threshold: str | None) -> None:
    """Check that thresholds are given for a decision, and for nothing else.

    :raises InputError: if one is given without the other
    """
    if (target == "decision") != bool(threshold):
        what = "target decision and threshold belong together, and only one is given"
        raise InputError(what, "give both, such as target decision and threshold 0.2")


def check_thresholds(text: str) -> str:
    """Thresholds that a person gives.

    :raises InputError: if they are none, or one is given twice
    """
    values = () if text == OF_DOSE else parse_thresholds(text)
    if twice := {threshold_text(one) for one in values if values.count(one) > 1}:
        raise InputError(f"thresholds {text!r} name {' and '.join(sorted(twice))} twice", "give each once")
    return text


def threshold_text(value: float) -> str:
    """A threshold with its unit: all below 1 are moistures."""
    return f"{100 * value:.3g} %" if value < 1 else f"{value:g} counts/s"


@dataclass(frozen=True)
class Thresholds:
    """Thresholds between the zones of a field.

    :param values: thresholds, rising: moisture [m^3/m^3], without a calibration rates [counts/s]
    :param rates_cps: their rates [counts/s]; rising moistures have falling rates
    :param prices: cost of a place per count/s beyond each threshold, in units of ``values``
    """

    values: tuple[float, ...]
    rates_cps: tuple[float, ...]
    prices: tuple[float, ...]

    @classmethod
    def of(cls, values: Sequence[float], curve: MoistureCurve | None) -> Thresholds:
        """Thresholds of the moisture, or of the rate without a curve.

        :param values: thresholds; one that is given n times costs n times as much
        :raises InputError: if a moisture is not one that the soil can have, or there is no calibration for it
        """
        if curve is None:
            if min(values) < 1:
                what = f"the threshold {min(values):g} looks like a moisture, but there is no calibration"
                raise InputError(what, "give the site's calibration, or a rate in counts/s, from 1")
            return cls(tuple(values), tuple(values), (1.0,) * len(values))
        limits = soil_limits(curve.bulk_density_gcm3)
        for value in values:
            if not limits.dryness < value < limits.saturation:
                percent = f"write {value / 100:g} for {value:g} %" if 1 < value < 100 else "give m3/m3"
                what = (
                    f"the threshold {value:g} is not between {limits.dryness:g} and {limits.saturation:.2g} m3/m3"
                )
                raise InputError(f"{what}, the moistures that this soil can have", percent)
        rates = np.asarray(curve.rate_cps(np.array(values)), float)
        return cls(tuple(values), tuple(rates.tolist()), tuple(np.abs(curve.slope(rates)).tolist()))

    def loss(self, rate: Array, variance: Array) -> Array:
        """Expected loss of places, shape (g,): that of the best zones with the variance of the rate, and the one
        that is saved with the variance by which further counts move its mean.
        """
        sd = np.sqrt(np.maximum(variance, _TINY))
        return np.asarray(sum(price * sd * _unit_loss(np.abs(rate - at) / sd) for at, price in self._each))

    def marginal(self, rate: Array, variance: Array) -> Array:
        """Derivative of :meth:`loss` by the variance, shape (g,)."""
        sd = np.sqrt(np.maximum(variance, _TINY))
        return np.asarray(sum(price * _density((rate - at) / sd) / (2 * sd) for at, price in self._each))

    def wrong(self, rate: Array, variance: Array, moved: Array | float = 0.0) -> float:
        """Share of places that can be expected to be in the wrong zone.

        :param moved: the part of the variance that further counts will have removed
        """
        from scipy.special import ndtri

        nodes = ndtri((np.arange(_NODES) + 0.5) / _NODES)[:, None]
        mean = rate + nodes / nodes.std() * np.sqrt(moved) if np.any(moved) else rate[None]
        return float(1 - probability_of_zone(mean, variance - moved, np.sort(self.rates_cps)).mean())

    def outside(self, rate: Array, variance: Array) -> tuple[float, ...]:
        """Thresholds that hardly any place is below, or hardly any is above."""
        from scipy.special import ndtr

        sd = np.sqrt(np.maximum(variance, _TINY))
        below = [float(ndtr((at - rate) / sd).mean()) for at in self.rates_cps]
        return tuple(
            value for value, share in zip(self.values, below, strict=True) if not PRESENT <= share <= 1 - PRESENT
        )

    @property
    def _each(self) -> zip[tuple[float, float]]:
        return zip(self.rates_cps, self.prices, strict=True)


def probability_of_zone(mean: Array, variance: Array, limits: Array) -> Array:
    """Probability that normal values lie in the zones of their means, in the shape of the means.

    :param variance: in a shape that fits to the means
    :param limits: rising limits between the zones
    """
    from scipy.special import ndtr

    sd = np.sqrt(np.maximum(variance, _TINY))
    edges = np.concatenate([[-math.inf], limits, [math.inf]])
    zone = np.searchsorted(limits, mean)
    return np.asarray(ndtr((edges[zone + 1] - mean) / sd) - ndtr((edges[zone] - mean) / sd))


def _density(u: Array) -> Array:
    return np.asarray(np.exp(-(u**2) / 2) / math.sqrt(2 * math.pi))


def _unit_loss(u: Array) -> Array:
    from scipy.special import ndtr

    return np.asarray(_density(u) - u * ndtr(-u))
