# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Samples of one or more surveys of a field: one variogram, but a mean rate of each survey."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.mapping.samples.samples import Samples, noise_rate

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Surveys:
    """Samples of surveys whose rates have one variogram.

    :param samples: samples of each survey at distinct places; the present survey comes first
    :param effects: known further structure E of each survey, shapes (n, k) [counts/s], such as covariates times
        the standard deviations of their effects: its rates have the covariance ``E E'`` in addition; ``None`` for
        none
    """

    samples: tuple[Samples, ...]
    effects: tuple[Array, ...] | None = None

    def __len__(self) -> int:
        return sum(map(len, self.samples))

    @property
    def places(self) -> Samples:
        """Samples of all surveys, one after the other."""
        joined = self.samples[0]
        for more in self.samples[1:]:
            joined = joined.joined(more)
        return joined

    @property
    def starts(self) -> list[int]:
        """Number of the first sample of each survey among all."""
        return [sum(map(len, self.samples[:number])) for number in range(len(self.samples))]

    @property
    def noise(self) -> Array:
        """Poisson variance of each rate, from the mean rate of its survey, shape (n,) [(counts/s)^2]."""
        return np.concatenate([noise_rate(one) / one.exposure_s for one in self.samples])

    def thinned(self, most: int) -> Surveys:
        """Places of each survey as points, evenly from its first to its last, about ``most`` in all."""
        share = min(1.0, most / len(self))
        parts = [
            np.linspace(0, len(one) - 1, max(round(share * len(one)), 1)).astype(np.intp) for one in self.samples
        ]
        samples = tuple(
            Samples(one.xy[some], one.counts[some], one.exposure_s[some])
            for one, some in zip(self.samples, parts, strict=True)
        )
        if self.effects is None:
            return Surveys(samples)
        return Surveys(samples, tuple(one[some] for one, some in zip(self.effects, parts, strict=True)))
