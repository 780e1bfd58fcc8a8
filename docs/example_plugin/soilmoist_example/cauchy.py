# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The Cauchy model: places stay alike over long distances."""

import numpy as np

from soilmoist_ros.mapping import CorrelationModel


def _correlation(q: np.ndarray) -> np.ndarray:
    return 1 / (1 + q)


def _with_slope(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    value = _correlation(q)
    return value, 2 * q * value**2


CAUCHY = CorrelationModel(_correlation, _with_slope, practical=19**0.5, label="Cauchy")
