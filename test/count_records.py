# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Records of counts for the tests of maps."""

import numpy as np
from hypothesis import strategies as st

from soilmoist_ros.sensing.records import NAN, CountRecord

records = st.builds(
    CountRecord, stamp_s=st.integers(0, 10_000).map(float), x_m=st.floats(0, 60, width=32),
    y_m=st.floats(0, 50, width=32), z_m=st.just(NAN), raw_counts=st.integers(0, 500), exposure_s=st.just(10.0),
    effective_exposure_s=st.floats(5, 20),
)  # fmt: skip


def record(x_m=10.0, y_m=20.0, **changes):
    values = {"stamp_s": 7.0, "z_m": NAN, "raw_counts": 40, "exposure_s": 10.0, "effective_exposure_s": 9.0}
    return CountRecord(x_m=x_m, y_m=y_m, **{**values, **changes})


def drive(count, step_m=(6.0, 0.0), start=(5.0, 20.0)):
    return [
        record(start[0] + i * step_m[0], start[1] + i * step_m[1], stamp_s=100.0 + 10.0 * i) for i in range(count)
    ]


def scattered(n=8):
    rng = np.random.default_rng(5)
    places = rng.uniform((2, 2), (58, 48), (n, 2)).astype(np.float32).tolist()
    return [
        CountRecord(1.78e9 + i, x, y, 30.0, int(rng.poisson(400)), 100.0, 95.0) for i, (x, y) in enumerate(places)
    ]
