# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The table of cutoff rigidities, and the script that computes it: scripts/cutoff_rigidity_table.py."""

import numpy as np
import pytest

from soilmoist_ros.sensing.corrections.intensity import MONITORS, cutoff_rigidity_gv


@pytest.fixture(scope="module")
def script(load_script):
    return load_script("cutoff_rigidity_table.py")


@pytest.fixture(scope="module")
def dipole(script, tmp_path_factory):
    path = tmp_path_factory.mktemp("igrf") / "dipole.shc"
    path.write_text("# a dipole\n1 1 1 2 1 2020.0 2020.0\n 2020.0\n1 0 -29404.8\n1 1 0.0\n1 -1 0.0\n")
    return script.Field(path, 2020.0, 1)


def test_the_field_of_a_dipole(dipole) -> None:
    field = dipole(np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 2.0, 0.0]]).T)
    assert field[:, 0] == pytest.approx([0, 0, 29404.8e-9])
    assert field[:, 1] == pytest.approx([0, 0, -2 * 29404.8e-9])
    assert field[:, 2] == pytest.approx([0, 0, 29404.8e-9 / 8])


@pytest.mark.slow
def test_traced_cutoffs_of_a_dipole_are_those_of_stoermer(script, dipole) -> None:
    equator, middle = script.cutoff_rigidities(dipole, np.array([(0.0, 0.0), (35.0, 120.0)]))
    # Stoermer's vertical cutoff is c B0 R / 4 cos^4(latitude) / r^2 [V].
    whole = script.SPEED_OF_LIGHT_MPS * 29404.8e-9 * script.EARTH_RADIUS_M / 4 / 1e9
    assert equator == pytest.approx(whole / np.linalg.norm(script.start(0.0, 0.0)[0]) ** 2, rel=0.005)
    # In middle latitudes the shadow of the earth adds a penumbra, of a fifth at most.
    x, y, z = script.start(35.0, 120.0)[0]
    stoermer = whole * (x * x + y * y) ** 2 / (x * x + y * y + z * z) ** 3
    assert stoermer < middle < 1.2 * stoermer


# Traced by the script in the field of 2020 (IGRF-14), between the points of the table.
@pytest.mark.parametrize(
    ("latitude", "longitude", "traced_gv"),
    [
        (38.2346, -97.571, 2.88),
        (53.268, -0.5245, 2.58),
        (-33.2, 147.7, 4.74),
        (12.3, 77.2, 17.34),
        (50.87, 6.45, 3.12),
        (36.1, -104.9, 3.78),
        (-31.4, -64.2, 9.06),
    ],
)
def test_values_between_the_points_of_the_table(latitude, longitude, traced_gv) -> None:
    assert cutoff_rigidity_gv(latitude, longitude) == pytest.approx(traced_gv, abs=0.2)


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
