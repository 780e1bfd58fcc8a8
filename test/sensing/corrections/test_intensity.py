# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import pytest

from soilmoist_ros.sensing.corrections.factors import Corrections
from soilmoist_ros.sensing.corrections.intensity import CosmicPlace, cosmic_place, intensity_scale

JUNGFRAUJOCH = CosmicPlace(4.49, 665.18)

# latitude, altitude, cutoff rigidity, then what crnpy returns for rates of 140 and 160 and a reference of 150:
# the divisor of Hawdon et al. and the factor of McJannet and Desilets.
REFERENCE = [
    (38.2346, 455.0, 3.1, (0.9263833333333333, 1.0736166666666667), (1.0756278551796299, 0.9343083778007669)),
    (51.35, 66.0, 2.93, (0.9255333333333333, 1.0744666666666667), (1.0741759111501186, 0.9354066326106066)),
    (-35.0, 600.0, 4.8, (0.9348833333333333, 1.0651166666666667), (1.0607293542695078, 0.9458478909592463)),
    (65.0, 15.0, 0.8, (0.9148833333333334, 1.0851166666666667), (1.0826603801900083, 0.9290664141578904)),
]


@pytest.mark.parametrize(("latitude", "altitude", "rigidity", "hawdon", "mcjannet"), REFERENCE)
def test_the_scaled_factors_agree_with_crnpy(latitude, altitude, rigidity, hawdon, mcjannet) -> None:
    site = cosmic_place(latitude, 0.0, altitude, rigidity)
    for scaling, answers in (("hawdon2014", [1 / divisor for divisor in hawdon]), ("mcjannet2023", mcjannet)):
        scale = intensity_scale(scaling, site, JUNGFRAUJOCH)
        corrections = Corrections(reference_intensity=150.0, intensity_scale=scale)
        assert [corrections.f_intensity(rate) for rate in (140.0, 160.0)] == pytest.approx(answers, rel=1e-12)


def test_the_monitor_itself_and_no_scaling_keep_the_ratio() -> None:
    for scaling in ("none", "hawdon2014", "mcjannet2023"):
        scale = intensity_scale(scaling, JUNGFRAUJOCH, JUNGFRAUJOCH)
        assert Corrections(reference_intensity=150.0, intensity_scale=scale).f_intensity(148.2) == 150.0 / 148.2


def test_impossible_scales_and_intensities_are_refused() -> None:
    with pytest.raises(ValueError, match="differ too much"):
        intensity_scale("hawdon2014", CosmicPlace(17.0, 1000.0), CosmicPlace(0.1, 1000.0))
    with pytest.raises(ValueError, match="far too low"):
        Corrections(reference_intensity=150.0, intensity_scale=1.3).f_intensity(20.0)
