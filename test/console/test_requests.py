# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Requests from the network (requests.py)."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from soilmoist_ros.console.requests import request_from_json, who_of
from soilmoist_ros.exploration.control.operator_request import OperatorRequest
from soilmoist_ros.foundation.errors import InputError

JSON = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
)
NAMES = ["robot", "verb", "who", "place", "dwell", "polygon", "stops", "hours", "until_sd", "other"]


def test_a_request_of_the_page():
    content = {"robot": "r1", "verb": "rule_out", "who": "Ada", "polygon": [[0, 1.5], [2, 3], [4, 5]]}
    assert request_from_json(content, ["r1"]) == (
        "r1", OperatorRequest("rule_out", "Ada", polygon=((0.0, 1.5), (2.0, 3.0), (4.0, 5.0))),
    )  # fmt: skip


def test_the_name_of_an_operator_has_no_control_characters():
    assert who_of({"who": "Ad\x1b[31ma\nB\u202e"}) == "Ada B"
    assert who_of({"who": "x" * 99}) == "x" * 60
    assert who_of({"who": 5}) == who_of(None) == ""


@pytest.mark.parametrize(
    "content",
    [
        [], None, {"verb": "start", "robot": "other"}, {"robot": ""}, {"robot": "", "verb": 1},
        {"robot": "", "verb": "measure", "place": [True, 1]}, {"robot": "", "verb": "measure", "place": "1,2"},
        {"robot": "", "verb": "start", "who": "A\nB"}, {"robot": "", "verb": "start", "who": "x" * 500},
        {"robot": "", "verb": "change", "hours": float("inf")}, {"robot": "", "verb": "start", "extra": 1},
        {"robot": "", "verb": "rule_out", "polygon": [[1, 2, 3]]},
        {"robot": "", "verb": "rule_out", "polygon": [[1, 2]] * 1000},
    ],
)  # fmt: skip
def test_what_is_refused(content):
    with pytest.raises(InputError):
        request_from_json(content, [""])


@given(st.dictionaries(st.sampled_from(NAMES), JSON) | JSON)
@pytest.mark.slow
def test_anything_is_a_request_or_refused(content):
    try:
        robot, request = request_from_json(content, [""])
    except InputError:
        return
    assert robot == ""
    assert isinstance(request, OperatorRequest)
