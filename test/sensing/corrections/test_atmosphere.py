# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import pytest

from soilmoist_ros.sensing.corrections.factors import (
    atmospheric_depth_gcm2,
    barometric_coefficient,
    standard_pressure_hpa,
)

# latitude, altitude, depth of crnpy, and beta of neptoon and crspy for a cutoff rigidity; both were run.
REFERENCE = [
    (38.2346, 455.0, 979.4738881057966, 3.1, 0.0073807859556057325),
    (51.35, 66.0, 1024.6285331173772, 2.93, 0.007312939212233243),
    (-35.0, 600.0, 962.9174015648462, 4.8, 0.0073433834421203605),
    (46.55, 3570.0, 665.1795136287324, 4.49, 0.0073517645834801915),
    (65.0, 15.0, 1029.686104322245, 0.8, 0.007252879144253025),
]


@pytest.mark.parametrize(("latitude", "altitude", "depth", "rigidity", "beta"), REFERENCE)
def test_depth_and_coefficient_agree_with_other_software(latitude, altitude, depth, rigidity, beta) -> None:
    assert atmospheric_depth_gcm2(latitude, altitude) == pytest.approx(depth, rel=1e-12)
    # The others average beta between the numbers of pressure and depth; here it is that at the depth.
    assert barometric_coefficient(depth, rigidity) == pytest.approx(beta, rel=4e-3)


def test_standard_pressure() -> None:
    assert standard_pressure_hpa(45.0, 0.0) == 1013.25
    assert standard_pressure_hpa(45.5, 1000.0) == pytest.approx(898.75, abs=0.2)  # US Standard Atmosphere 1976


@pytest.mark.parametrize(("latitude", "altitude"), [(91.0, 0.0), (0.0, 9001.0), (0.0, float("nan"))])
def test_places_outside_the_earth_are_refused(latitude, altitude) -> None:
    with pytest.raises(ValueError, match="there is no place"):
        standard_pressure_hpa(latitude, altitude)


def test_the_coefficient_has_limits() -> None:
    with pytest.raises(ValueError, match="no barometric coefficient"):
        barometric_coefficient(1033.0, 25.0)
