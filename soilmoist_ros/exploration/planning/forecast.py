"""Forecast of the map's standard deviation while a mission goes on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

SOON_S = 600.0
"""Time ahead for which a gain is stated [s]."""
BAND = 0.25
"""Relative half width of the band about a forecast within which the standard deviation ends up nearly always."""


@dataclass(frozen=True, slots=True)
class Forecast:
    """Standard deviation of the map now and later: the root of its mean variance over the field, nugget included.

    Standard deviations of a rate map are shares of the mean rate [-], those of a moisture map are [m^3/m^3].

    :param sd: now
    :param times_s: times from now, rising; the last is the end of the mission [s]
    :param sds: at these times, if the mission goes on
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
        return self.sds[-1]

    def at(self, after_s: float) -> float:
        """Standard deviation after some time [s], up to the end."""
        return float(np.interp(after_s, (0.0, *self.times_s), (self.sd, *self.sds)))

    @property
    def unit(self) -> str:
        """What a hundredth of the standard deviations is."""
        return "% by volume" if self.moisture else "% of the rate"

    @property
    def text(self) -> str:
        """The forecast in words, as ``±2.4 % of the rate now, ±2.0 % in 35 min``."""
        text = f"±{_percent(self.sd)} {self.unit} now, ±{_percent(self.sd_end)} % in {_minutes(self.times_s[-1])}"
        return text if self.hidden is None else f"{text}; {self.uniform}"

    @property
    def uniform(self) -> str:
        """What is known of a field whose counts show no differences, in words."""
        assert self.hidden is not None
        return f"the counts show no differences, and the rate varies by less than ±{100 * self.hidden:.0f} %"


def _percent(share: float) -> str:
    return f"{100 * share:.{1 if share < 0.0995 else 0}f}"


def _minutes(time_s: float) -> str:
    return f"{time_s / 60:.0f} min"
