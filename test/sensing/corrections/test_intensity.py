import pytest

from soilmoist_ros.sensing.corrections.cutoff_rigidity import cutoff_rigidity_gv
from soilmoist_ros.sensing.corrections.factors import Corrections
from soilmoist_ros.sensing.corrections.intensity import MONITORS, CosmicPlace, cosmic_place, intensity_scale

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


# Values of the database NMDB, mostly of the years 1965 to 2000.
@pytest.mark.parametrize(
    ("code", "published_gv", "tolerance_gv"),
    [
        ("OULU", 0.81, 0.2),
        ("KIEL", 2.36, 0.2),
        ("LMKS", 3.84, 0.2),
        ("JUNG", 4.49, 0.4),
        ("ROME", 6.27, 0.4),
        ("ATHN", 8.53, 0.4),
        ("PSNM", 16.8, 0.3),
        ("NEWK", 2.40, 0.6),
        ("HRMS", 4.58, 0.4),
        ("KERG", 1.14, 0.2),
        ("TSMB", 9.15, 0.4),
        ("PTFM", 6.98, 0.3),
        ("TERA", 0.01, 0.1),
        ("THUL", 0.3, 0.3),
    ],
)
def test_the_table_gives_the_cutoff_rigidity_of_the_monitors(code, published_gv, tolerance_gv) -> None:
    _, latitude, longitude, _ = MONITORS[code]
    assert cutoff_rigidity_gv(latitude, longitude) == pytest.approx(published_gv, abs=tolerance_gv)


def test_the_table_is_continuous_around_the_world() -> None:
    assert cutoff_rigidity_gv(40.0, 179.999) == pytest.approx(cutoff_rigidity_gv(40.0, -179.999), abs=0.01)
    assert cutoff_rigidity_gv(40.0, 284.25) == cutoff_rigidity_gv(40.0, -75.75)
    assert cutoff_rigidity_gv(90.0, 12.0) == cutoff_rigidity_gv(90.0, -170.0) == 0.0
    assert cutoff_rigidity_gv(-90.0, 0.0) < 0.2
    with pytest.raises(ValueError, match="latitude"):
        cutoff_rigidity_gv(91.0, 0.0)
