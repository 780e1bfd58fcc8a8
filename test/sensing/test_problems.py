# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Kinds of problems are codes; severity is data."""

import pytest

from soilmoist_ros.foundation.errors import Mistake
from soilmoist_ros.sensing.problems import Kind, Problem, Severity


def test_a_kind_is_its_code_and_has_a_text_and_a_severity() -> None:
    assert Kind("no_position") is Kind.NO_POSITION
    assert str(Kind.NO_POSITION) == "no_position"
    assert Kind.NO_POSITION.text == "no position"
    assert [kind.value for kind in Kind] == [kind.name.lower() for kind in Kind]
    assert len({kind.text for kind in Kind}) == len(Kind)


@pytest.mark.parametrize("kind", Kind)
def test_what_is_lost_is_an_error_but_for_duplicates(kind) -> None:
    mistake = Mistake("something")
    assert Problem(kind, mistake).severity is kind.severity
    expected = kind.severity if kind is Kind.DUPLICATE else Severity.ERROR
    assert Problem(kind, mistake, lost=True).severity is expected
