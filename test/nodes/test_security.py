# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The policy of SROS 2 names what nodes use and nothing else; none runs without the security asked for."""

import os
import stat
import subprocess
import sys
import time
from pathlib import Path
from xml.etree import ElementTree

import pytest

pytest.importorskip("rclpy")

from rcl_interfaces.srv import ListParameters
from ros_system import RosSystem, security_environment

ROOT = Path(__file__).resolve().parents[2]
POLICY = ROOT / "config" / "security" / "policy.xml"
KINDS = {
    ("topics", "publish"): "publisher",
    ("topics", "subscribe"): "subscriber",
    ("services", "reply"): "service",
    ("services", "request"): "client",
}
ANY = "/*"
OF_EACH_ROBOT = ("counts", "quarantined_counts", "place_doubts", "mission_state")
FIELD = {"field": "smooth"}
PLANNERS = (
    {"navigator": "goto_node"},
    {"navigator": "navigate_to_pose", "keepout_topic": "keepout"},
    {"navigator": "follow_route"},
    {"navigator": "goal_pose"},
)
USED = {
    "sensor_driver": [
        {**FIELD, "logger_uri": "tcp://127.0.0.1:9", "gnss_uri": uri} for uri in ("tcp://127.0.0.1:9", "")
    ],
    "mapper": [FIELD],
    "planner": [{**FIELD, **navigation} for navigation in PLANNERS],
    "recorder": [{}],
    "watchdog": [{"silent_s": 0.8}],
    "console": [{**FIELD, "port": 0}],
    "field_simulator": [
        {**FIELD, "logger_port": 0, "gnss_port": 0, "scenario": scenario} for scenario in ("", "thorvald")
    ],
}  # fmt: skip
"""Parameters with which a node makes all its topics and services."""
_ACTIONS = ("compute_and_track_route", "follow_path", "navigate_to_pose", "topological_navigation")
ON_A_ROBOT = {
    ("watchdog", "client"): {f"/{name}/_action/cancel_goal" for name in _ACTIONS},
    ("watchdog", "subscriber"): {f"/{name}/_action/status" for name in _ACTIONS},
}
"""What a node uses where a navigation is there."""


SEE_ALL = ("operator", "r1/console")


def full_name(name, namespace, node):
    below = namespace.rstrip("/")
    return name if name.startswith("/") else f"{below}/{name.replace('~', node, 1)}"


def permitted(profile):
    namespace, node = profile.attrib["ns"], profile.attrib["node"]
    found = {kind: set() for kind in KINDS.values()}
    for block in profile:
        for how in block.attrib:
            names = {full_name(one.text, namespace, node) for one in block}
            if block.tag == "actions":
                asking, hearing = {"call": ("client", "subscriber"), "execute": ("service", "publisher")}[how]
                found[asking] |= {
                    f"{one}/_action/{part}" for one in names for part in ("send_goal", "cancel_goal", "get_result")
                }
                found[hearing] |= {f"{one}/_action/{part}" for one in names for part in ("feedback", "status")}
            else:
                found[KINDS[block.tag, how]] |= names
    return found  # fmt: skip


def settled(ros, nodes):
    """Names by kind of each node of the graph, when nothing new has appeared for a second."""

    def now():
        if not set(nodes) <= set(ros.node.get_node_names()):
            return None
        return {
            node: {
                kind: {name for name, _ in getattr(ros.node, f"get_{kind}_names_and_types_by_node")(node, "/")}
                for kind in KINDS.values()
            }
            for node in nodes
        }

    def still():
        before = now()
        time.sleep(1.0)
        return before if before is not None and before == now() else None

    return ros.wait_for(still, message=f"the graph of {nodes}")


def profiles(node):
    enclave = ElementTree.parse(POLICY).getroot().find(f"enclaves/enclave[@path='/soilmoist/{node}']")
    return {one.attrib["node"]: one for one in enclave.iter("profile")}


@pytest.mark.parametrize("node", USED)
def test_the_policy_permits_what_a_node_uses_and_nothing_else(node, tmp_path):
    allowed = {name: permitted(profile) for name, profile in profiles(node).items()}
    # the recorder reads the parameters of nodes that it sees
    beside = ("mapper", "sensor_driver", "planner") if node == "recorder" else ()
    found = {name: {kind: set() for kind in KINDS.values()} for name in allowed}
    for number, values in enumerate(USED[node]):
        folder = tmp_path / str(number)
        folder.mkdir()
        with RosSystem(folder) as ros:
            for other in beside:
                ros.start(other, params=USED[other][0])
            ros.start(node, params=values or {"out": str(folder / "out")})
            ros.call(ListParameters, f"/{node}/list_parameters")  # it answers when it has made all it makes
            for name, kinds in settled(ros, allowed).items():
                for kind, names in kinds.items():
                    found[name][kind] |= names
    for name, kinds in found.items():
        for kind, names in kinds.items():
            if allowed[name][kind] == {ANY}:
                continue
            assert names | ON_A_ROBOT.get((name, kind), set()) == allowed[name][kind], f"{kind} of {name}"


def test_robots_get_enclaves_of_their_own_and_see_each_others_mission(load_script):
    tree = load_script("keystore").policy(["/r1", "/r2"], ["salt"])
    enclaves = {one.attrib["path"]: one for one in tree.getroot().iter("enclave")}
    assert {"/soilmoist/r1/mapper", "/soilmoist/r1/salt/mapper", "/soilmoist/r2/console"} <= set(enclaves)
    assert [path for path in enclaves if path.endswith("operator")] == ["/soilmoist/operator"], "one for all"
    assert not any(path.endswith("field_simulator") for path in enclaves)
    kinds = permitted(next(enclaves["/soilmoist/r1/planner"].iter("profile")))
    assert {"/r2/mission", "/r1/salt/samples", "/r1/samples", "/diagnostics"} <= kinds["subscriber"]
    assert "/r1/salt/mapper/save" in kinds["client"]
    assert not any(name.startswith("/r2") for name in kinds["publisher"] | kinds["service"] | kinds["client"])
    assert "/topological_map_2" in kinds["subscriber"], "the map of the navigation is outside the namespaces"
    mapper = permitted(next(enclaves["/soilmoist/r1/mapper"].iter("profile")))
    of_robots = {f"{robot}/{topic}" for robot in ("/r1", "/r2") for topic in OF_EACH_ROBOT}
    assert mapper["subscriber"] == of_robots, "what the mapper of a team hears, and nothing else"
    assert not any("held" in name or "missed" in name for name in mapper["publisher"])
    of_salt = permitted(next(enclaves["/soilmoist/r1/salt/mapper"].iter("profile")))["subscriber"]
    assert {"/r1/salt/counts", "/r1/mission_state"} <= of_salt
    assert "/r2/counts" not in of_salt
    of_recorder = permitted(next(enclaves["/soilmoist/r1/recorder"].iter("profile")))["client"]
    assert "/r1/salt/mapper/get_parameters" in of_recorder
    operator, console = (permitted(next(enclaves[f"/soilmoist/{one}"].iter("profile"))) for one in SEE_ALL)
    stops = {"/r1/emergency_stop", "/r2/emergency_stop"}
    assert stops <= operator["publisher"] & console["publisher"]
    assert {"/r1/planner/command", "/r2/planner/command"} <= console["client"]
    seen = ("battery_state", "fix", "mission", "mission_state", "plan", "visits")
    assert {f"{robot}/{topic}" for robot in ("/r1", "/r2") for topic in seen} <= console["subscriber"]
    assert "/r2/soil_map" not in console["subscriber"], "it shows the map of its own namespace"


def test_a_keystore_is_for_its_owner_alone(tmp_path):
    tool = tmp_path / "ros2"
    tool.write_text(f'#!{sys.executable}\nimport sys\nopen(sys.argv[4], "w").write("a key")\n')
    tool.chmod(0o755)
    path = f"{tmp_path}{os.pathsep}{os.environ['PATH']}"
    made = tmp_path / "keys"
    command = [sys.executable, str(ROOT / "scripts" / "keystore"), str(made)]
    subprocess.run(command, env={**os.environ, "PATH": path}, umask=0o022, check=True, capture_output=True)
    assert stat.S_IMODE(made.stat().st_mode) == 0o600


def test_only_keys_for_rehearsals_let_a_simulator_set_the_time(load_script):
    policy = load_script("keystore").policy
    for rehearsal in (False, True):
        tree = policy(["/r1"], ["salt"], rehearsal).getroot()
        profiles = {one.attrib["node"]: permitted(one) for one in tree.iter("profile")}
        assert ("field_simulator" in profiles) == rehearsal
        assert ("/clock" in profiles["planner"]["subscriber"]) == rehearsal
    assert {"/clock", "/r1/salt/counts", "/r1/closest_node"} <= profiles["field_simulator"]["publisher"]


def test_nobody_but_the_planner_may_send_goals_and_nobody_at_all_may_set_parameters_but_the_operator():
    tree = ElementTree.parse(POLICY).getroot()
    callers = {one.attrib["path"] for one in tree.iter("enclave") if one.find(".//actions[@call]") is not None}
    setters = {
        enclave.attrib["path"]
        for enclave in tree.iter("enclave")
        for block in enclave.iterfind(".//services[@request]")
        if any("set_param" in one.text or one.text == "*" for one in block)
    }
    assert callers == {"/soilmoist/planner", "/soilmoist/field_simulator"}, "the latter to its own navigation"
    assert setters == {"/soilmoist/operator"}


def test_a_node_refuses_to_run_in_the_open_where_security_is_enforced(ros, tmp_path):
    ros.environment |= security_environment(tmp_path / "keystore")
    mapper = ros.start("mapper", params=FIELD, extra=["--enclave", "/soilmoist/mapper"])
    assert mapper.wait() == 2
    assert "ROS cannot start the node" in mapper.output()
    assert "scripts/keystore" in mapper.output()
    assert "Traceback" not in mapper.output()
