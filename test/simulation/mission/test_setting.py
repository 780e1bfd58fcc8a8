# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""How the value of a setting is checked (setting.py)."""

import math

import pytest

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.simulation import MissionSettings
from soilmoist_ros.simulation.mission.settings import SETTINGS


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("hours", 0, "must be > 0"),
        ("hours", math.inf, "must be finite"),
        ("hours", 10**400, "must be finite"),
        ("hours", True, "must be a number"),
        ("seed", -1, "must be >= 0"),
        ("robots", 1.5, "must be a whole number"),
        ("footprint_m", -0.1, "must be >= 0"),
        ("strategy", "gredy", "did you mean 'greedy'"),
        ("model", "matern23", "did you mean 'matern"),
        ("dwell", "ami:3", "did you mean 'ami:3%'"),
        ("weather", 1, "must be true or false"),
        ("field", "", "must not be empty"),
        ("preset", "papers", "did you mean 'paper'"),
    ],
)
def test_a_value_that_is_not_allowed_is_named(name, value, message):
    with pytest.raises(InputError, match=f"{name}: .*{message}"):
        MissionSettings(**{name: value}).check()


def test_a_decimal_comma_is_named():
    with pytest.raises(ValueError, match=r"must be a number, but it is '0,5' -> write 0\.5"):
        SETTINGS["hours"].parsed("0,5")


def test_a_whole_number_of_a_parser_is_a_number():
    """As ruamel reads ``0`` in a campaign file."""

    class Number(int):
        pass

    assert type(SETTINGS["drift"].checked(Number(0))) is float
