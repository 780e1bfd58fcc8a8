# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import pytest

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.sensing.corrections.factors import atmospheric_depth_gcm2, barometric_coefficient
from soilmoist_ros.sensing.corrections.intensity import cutoff_rigidity_gv
from soilmoist_ros.sensing.moisture.site import Site, load_site

KANSAS = {"latitude_deg": 38.2346, "longitude_deg": -97.571, "altitude_m": 455}


def test_auto_values_follow_from_the_place() -> None:
    pressure = {"beta_per_hpa": "auto", "reference_hpa": "auto"}
    for site in (
        Site(location=KANSAS, corrections={"pressure": pressure, "cutoff_rigidity_gv": 3.1}),
        Site(corrections={"pressure": pressure, "cutoff_rigidity_gv": 3.1, "place": KANSAS}),
    ):
        parameters = site.corrections_parameters
        assert parameters.beta_per_hpa == barometric_coefficient(atmospheric_depth_gcm2(38.2346, 455), 3.1)
        assert parameters.reference_pressure_hpa == pytest.approx(959.8, abs=0.1)
        assert parameters.f_pressure(parameters.reference_pressure_hpa) == 1.0


def test_scaling_uses_the_place_of_the_monitor() -> None:
    intensity = {"reference": 150, "constant": 148, "scaling": "hawdon2014", "monitor": "jung"}
    site = Site(location=KANSAS, corrections={"intensity": intensity, "cutoff_rigidity_gv": 3.0})
    jungfraujoch_gv = cutoff_rigidity_gv(46.55, 7.98)
    scale = site.corrections_parameters.intensity_scale
    assert scale == pytest.approx(1 + 0.075 * (jungfraujoch_gv - 3.0), abs=1e-3)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("corrections: {pressure: {beta_per_hpa: auto}}", "'beta_per_hpa' follows from the place"),
        (
            "location: {latitude_deg: 1, longitude_deg: 2}\ncorrections: {pressure: {reference_hpa: auto}}",
            "'reference_hpa' follows from the place",
        ),
        (
            "corrections: {intensity: {reference: 1, constant: 1, scaling: hawdon2014}}",
            "the scaling hawdon2014 needs a 'monitor'",
        ),
        ("corrections: {intensity: {reference: 1, constant: 1, monitor: JUGN}}", "did you mean 'JUNG'?"),
        ("corrections: {pressure: {beta_per_hpa: automatic}}", "number"),
    ],
)
def test_a_value_without_its_basis_is_refused(tmp_path, text, message) -> None:
    path = tmp_path / "site.yaml"
    path.write_text(text + "\n")
    with pytest.raises(InputError) as caught:
        load_site(path)
    assert message in str(caught.value)
    assert len(caught.value.mistakes) == 1
