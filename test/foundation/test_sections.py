# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""All mistakes of a configuration file are reported at once, each with its line and what to do."""

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
