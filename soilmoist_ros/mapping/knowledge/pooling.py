# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Fewer samples where there are thousands: pools of neighbours keep counts, exposure and second moments."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.mapping.samples.samples import Samples
from soilmoist_ros.mapping.samples.spread import full_spread, without_noise
from soilmoist_ros.mapping.variogram.reml import spatial_blocks

Array = NDArray[np.float64]


def pooled(samples: Samples, most: int) -> Samples:
    """The samples, or at most ``most`` pools of neighbours, each with the area over which it was counted.

    :param samples: at least one
    :param most: maximum number, >= 1
    """
    if len(samples) <= most:
        return samples
    pool = np.empty(len(samples), int)
    for number, block in enumerate(spatial_blocks(samples.xy, 0, -(-2 * len(samples) // most))):
        pool[block] = number

    def summed(values: Array) -> Array:
        return np.stack([np.bincount(pool, column) for column in np.atleast_2d(values.T)], axis=-1).astype(float)

    counts, exposure_s = summed(samples.counts)[:, 0], summed(samples.exposure_s)[:, 0]
    weight = samples.exposure_s / exposure_s[pool]
    centre = summed(samples.xy * weight[:, None])
    x, y = (samples.xy - centre[pool]).T
    spread = summed((samples.spread + full_spread(np.column_stack([x * x, x * y, y * y]))) * weight[:, None])
    return Samples(centre, counts, exposure_s, without_noise(spread))
