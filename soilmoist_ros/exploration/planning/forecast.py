# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Forecast of the map's standard deviation while a mission goes on."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from soilmoist_ros.foundation import read_json

SOON_S = 600.0
"""Time ahead for which a gain is stated [s]."""


@dataclass(frozen=True, slots=True)
class Forecast:
    """Standard deviation of the map now and later: the root of its mean variance over the field, nugget included.

    Standard deviations of a rate map are shares of the mean rate [-], those of a moisture map are [m^3/m^3].

    :param sd: now
    :param times_s: times from now, rising; the last is the end of the mission [s]; none at the end
    :param sds: at these times, if the mission goes on
    :param factors: bands about them: in four of five missions the standard deviation ends up between
        ``sd / factor`` and ``sd * factor``
    :param sd_soon: after :data:`SOON_S`, if the mission goes on
    :param mean_rate_cps: mean rate of the map [counts/s]
    :param moisture: whether the standard deviations are those of the moisture
    :param hidden: upper limit (95 %) of the standard deviation of the field about its mean, as a share of the mean
        rate, if the counts so far show no difference between places; ``None`` if they do, or it is too early
    :param is_guess: whether it is made before there is a map
    """

    sd: float
    times_s: tuple[float, ...]
    sds: tuple[float, ...]
    factors: tuple[float, ...]
    sd_soon: float
    mean_rate_cps: float
    moisture: bool = False
    hidden: float | None = None
    is_guess: bool = False

    @property
    def gain(self) -> float:
        """Share by which the standard deviation falls in the next :data:`SOON_S`."""
        return 1 - self.sd_soon / self.sd if self.sd > 0 else 0.0

    @property
    def sd_end(self) -> float:
        """Standard deviation at the end of the mission."""
        return self.sds[-1] if self.sds else self.sd

    @property
    def band_end(self) -> tuple[float, float]:
        """Band of the standard deviation at the end of the mission."""
        factor = self.factors[-1] if self.factors else 1.0
        return self.sd_end / factor, self.sd_end * factor

    def at(self, after_s: float) -> float:
        """Standard deviation after some time [s], up to the end."""
        return float(np.interp(after_s, (0.0, *self.times_s), (self.sd, *self.sds)))

    @property
    def unit(self) -> str:
        """What a hundredth of the standard deviations is."""
        return "% by volume" if self.moisture else "% of the rate"

    @property
    def text(self) -> str:
        """The forecast in words, as ``±2.4 % of the rate now, ±2.0 % (1.7 to 2.4) in 35 min``."""
        text = f"±{hundredths(self.sd)} {self.unit} now"
        if self.times_s:
            text += f", {self.end_text} in {self.times_s[-1] / 60:.0f} min"
        return text if self.hidden is None else f"{text}; {self.uniform}"

    @property
    def end_text(self) -> str:
        """Standard deviation and band at the end of the mission, as ``±2.0 % (1.7 to 2.4)``."""
        low, high = map(hundredths, self.band_end)
        return f"±{hundredths(self.sd_end)} % ({low} to {high})"

    @property
    def uniform(self) -> str:
        """What is known of a field whose counts show no differences, in words."""
        assert self.hidden is not None
        return f"the counts show no differences, and the rate varies by less than ±{100 * self.hidden:.0f} %"


def hundredths(sd: float) -> str:
    """A standard deviation in hundredths, to two digits."""
    return f"{100 * sd:.{1 if sd < 0.0995 else 0}f}"


def forecast_to_text(forecast: Forecast | None) -> str:
    """A forecast as JSON, to four digits; empty without one."""
    return "" if forecast is None else json.dumps(_rounded(asdict(forecast)), separators=(",", ":"))


def forecast_from_text(text: str) -> Forecast | None:
    """The forecast that :func:`forecast_to_text` wrote.

    :raises ValueError: if the text is not one
    """
    if not text:
        return None
    try:
        values = read_json(text)
        lists = {name: tuple(float(value) for value in values[name]) for name in ("times_s", "sds", "factors")}
        numbers = {name: float(values[name]) for name in ("sd", "sd_soon", "mean_rate_cps")}
        if len(set(map(len, lists.values()))) > 1:
            raise ValueError("its lists differ in length")
        hidden = values.get("hidden")
        return Forecast(**{**values, **lists, **numbers, "hidden": None if hidden is None else float(hidden)})
    except (TypeError, KeyError, ValueError, OverflowError) as error:
        raise ValueError(f"{text[:40]!r} is not a forecast: {error}") from None


def _rounded(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _rounded(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_rounded(item) for item in value]
    return float(f"{value:.4g}") if isinstance(value, float) else value
