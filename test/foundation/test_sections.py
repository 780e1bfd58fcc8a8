# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""All mistakes of a configuration file are reported at once, each with its line and what to do."""

import re
from typing import Literal

import pytest

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.foundation.sections import Section, load_model


class Tube(Section):
    volume_l: float
    gas: str = "helium"


class Logger(Section):
    name: str
    tubes: list[Tube]


def test_a_file_becomes_a_model(tmp_path):
    path = tmp_path / "logger.yaml"
    path.write_text("name: rover\ntubes:\n- volume_l: 2.5\n- {volume_l: 1, gas: boron}\n")
    assert load_model(path, Logger) == Logger(
        name="rover", tubes=[Tube(volume_l=2.5), Tube(volume_l=1, gas="boron")]
    )


def test_every_mistake_has_its_line_and_a_remedy(tmp_path):
    path = tmp_path / "logger.yaml"
    path.write_text("nam: rover\ntubes:\n- volume_l: 2.5\n- volume_l: big\n")
    with pytest.raises(InputError) as caught:
        load_model(path, Logger)
    mistakes = {(mistake.line, mistake.column): mistake for mistake in caught.value.mistakes}
    assert sorted(mistakes) == [(0, "name"), (1, "nam"), (4, "tubes.1.volume_l")]
    assert mistakes[1, "nam"].remedy == "remove it or use one of: name, tubes (did you mean 'name'?)"
    assert "but it is 'big'" in mistakes[4, "tubes.1.volume_l"].message


@pytest.mark.parametrize(("text", "said"), [("", "nothing"), ("- a", "a list"), ("a", "a single value")])
def test_a_file_without_keys_is_refused(tmp_path, text, said):
    path = tmp_path / "logger.yaml"
    path.write_text(text)
    with pytest.raises(InputError, match=f"should hold keys and values, but holds {said}"):
        load_model(path, Logger)


class Place(Section):
    latitude_deg: float
    longitude_deg: float


class Journey(Section):
    start: Place
    day: str = ""
    curve: Literal["desilets", "universal"] = "desilets"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("start: [53.2, -0.5]\n", "is [53.2, -0.5] -> write its keys, such as {latitude_deg: ...}"),
        ("start: {latitude_deg: 53 16 4.8 N, longitude_deg: 0}\n", "write degrees with decimals"),
        (
            "start: {latitude_deg: 0, longitude_deg: '0°31\\'28.2\"W'}\n".replace("\\'", "''"),
            "write degrees with decimals",
        ),
        ("start: {latitude_deg: 0, longitude_deg: 0}\ncurve: Desilets\n", "write desilets"),
        ("start: {latlon: 0}\n", "longitude comes first"),
        ("day: a\nday: b\n", 'duplicate key "day" with value "b" (original value: "a") -> remove one of the two'),
    ],
)
def test_values_of_another_form_get_a_remedy_that_fits(tmp_path, text, said):
    path = tmp_path / "journey.yaml"
    path.write_text(text)
    with pytest.raises(InputError, match=re.escape(said)):
        load_model(path, Journey)


def test_a_date_without_quotes_is_a_text(tmp_path):
    path = tmp_path / "journey.yaml"
    path.write_text("start: {latitude_deg: 0, longitude_deg: 0}\nday: 2026-05-02\n")
    assert load_model(path, Journey).day == "2026-05-02"
