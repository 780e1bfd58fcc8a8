# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import pytest
from hypothesis import given
from hypothesis import strategies as st

from soilmoist_ros.exploration.planning.properties import property_name, property_weights
from soilmoist_ros.foundation.errors import InputError


def test_names_with_and_without_weights():
    texts = ["compaction:0.5", "/salt", "r1/clay/", "/depth_2:0", "compaction:2"]
    assert property_weights(texts) == {"compaction": 2.0, "/salt": 1.0, "r1/clay": 1.0, "/depth_2": 0.0}
    assert property_weights([]) == {}


@pytest.mark.parametrize(
    "text", ["", "/", "a b", "2nd", "a//b", "a/2", "a-b", "a:", "a:much", "a:-1", "a:nan", "a:inf"]
)
def test_what_is_no_namespace_with_a_weight_is_refused(text):
    with pytest.raises(InputError, match="is not a namespace with a weight"):
        property_weights([text])


@pytest.mark.parametrize(
    ("field", "name"),
    [
        ("rough", "rough"),
        ("synthetic-low", "synthetic_low"),
        ("fields/my clay.yaml", "my_clay"),
        ("fields/layer.2.yml", "layer_2"),
        ("2nd.yaml", "property_2nd"),
    ],
)
def test_the_name_of_a_field_makes_a_namespace(field, name):
    assert property_name(field) == name


@pytest.mark.slow
@given(st.text())
def test_any_name_makes_one(field):
    name = property_name(field)
    assert property_weights([name]) == {name: 1.0}
    assert "/" not in name
