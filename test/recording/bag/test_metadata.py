# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import json

import pytest
from bags import STORE
from hypothesis import given
from hypothesis import strategies as st
from rosbags.typesys import get_types_from_msg, get_typestore
from rosbags.typesys.stores import Stores

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.recording import Qos, find_definition, request_for
from soilmoist_ros.recording.bag.metadata import INFINITE_NS, qos_from_yaml, search_prefixes, to_yaml

QOS = st.builds(
    Qos, st.sampled_from(["keep_last", "keep_all", "system_default", "unknown"]), st.integers(0, 1000),
    st.sampled_from(["reliable", "best_effort", "system_default", "unknown"]),
    st.sampled_from(["volatile", "transient_local", "system_default", "unknown"]), st.integers(0, INFINITE_NS),
    st.integers(0, INFINITE_NS), st.sampled_from(["automatic", "manual_by_topic", "system_default", "unknown"]),
    st.integers(0, INFINITE_NS),
)  # fmt: skip


@pytest.mark.slow
@given(st.lists(QOS, max_size=3))
def test_quality_of_service_comes_back_as_it_was(offered):
    assert qos_from_yaml(to_yaml([qos.to_dict() for qos in offered])) == tuple(offered)


@given(st.lists(QOS, min_size=1, max_size=4))
def test_a_request_is_one_that_every_publisher_can_meet(offered):
    request = request_for(offered)
    assert request.reliable == all(qos.reliability == "reliable" for qos in offered)
    assert request.latched == all(qos.durability == "transient_local" for qos in offered)
    assert request.depth >= max(qos.depth for qos in offered)


LINE = "=" * 80


@pytest.fixture
def prefix(tmp_path):
    def install(name, text, **type_hash):
        package, kind = name.split("/")
        path = tmp_path / "share" / package / "msg" / f"{kind}.msg"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
        if type_hash:
            hashes = [{"type_name": f"{package}/msg/{kind}", "hash_string": type_hash["type_hash"]}]
            path.with_suffix(".json").write_text(json.dumps({"type_hashes": hashes}))

    install("far_msgs/Point", "float64 x\nfloat64 y")
    install("near_msgs/Part", "far_msgs/Point place # not far_msgs/Missing here\nstring<=10 name")
    install(
        "near_msgs/Whole",
        "# near_msgs/Comment\nint8 A=1\nstring TEXT='far_msgs/No x'\nPart[<=3] parts\nPart[] again\n"
        "bool[2] flags\nfar_msgs/Point[4] corners\nuint8 b 7",
        type_hash="RIHS01_abc",
    )
    install("near_msgs/Broken", "Missing x")
    return tmp_path


def test_types_within_a_type_come_after_it_once(prefix):
    definition = find_definition("near_msgs/msg/Whole", [prefix])
    first, *rest = definition.text.split(f"\n{LINE}\n")
    assert first.startswith("# near_msgs/Comment")
    assert [part.splitlines()[0] for part in rest] == ["MSG: near_msgs/Part", "MSG: far_msgs/Point"]
    assert definition.type_hash == "RIHS01_abc"
    assert definition.encoding == "ros2msg"
    assert "near_msgs/msg/Part" in get_types_from_msg(definition.text, "near_msgs/msg/Whole")


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("near_msgs/msg/Nothing", "near_msgs/msg/Nothing is not installed"),
        ("near_msgs/msg/Broken", "near_msgs/msg/Missing is not installed"),
        ("near_msgs/srv/Trigger", "not the name of a message type"),
        ("../msg/x", "not the name of a message type"),
        ("String", "not the name of a message type"),
    ],
)
def test_a_type_that_is_not_there_is_named(prefix, name, message):
    with pytest.raises(InputError, match=message):
        find_definition(name, [prefix])


def test_the_environment_says_where_to_look(prefix, monkeypatch):
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"/nowhere:{prefix}")
    assert search_prefixes()[:2] == [type(prefix)("/nowhere"), prefix]
    assert find_definition("far_msgs/msg/Point").text == "float64 x\nfloat64 y"


@pytest.mark.parametrize(
    "name",
    ["sensor_msgs/msg/PointCloud2", "nav_msgs/msg/OccupancyGrid", "diagnostic_msgs/msg/DiagnosticArray",
     "visualization_msgs/msg/MarkerArray", "action_msgs/msg/GoalStatusArray", "rcl_interfaces/msg/ParameterEvent"],
)  # fmt: skip
def test_installed_types_have_the_hash_of_their_definition(name):
    # rosbags computes the hash from the definition; ROS stores it next to the definition.
    pytest.importorskip(name.split("/")[0])
    definition = find_definition(name)
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(definition.text, name))
    assert store.hash_rihs01(name) == definition.type_hash == STORE.hash_rihs01(name)
