# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Bags, mapped again: bag_map.py, mission.py, properties.py."""

from __future__ import annotations

import dataclasses
import importlib.util
import json
import re
import shutil
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from copied_bags import STORE, copy_bag
from earlier_folders import MAY_S, records, run_folder
from rosbags.rosbag2 import StoragePlugin, Writer

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.mapping import FieldGrid, FieldMap
from soilmoist_ros.pipeline import MapSettings, ReplaySettings, map_logs, replay_bag
from soilmoist_ros.pipeline import bag_map as no_map
from soilmoist_ros.pipeline.bag_lines import STATUS
from soilmoist_ros.pipeline.bag_map import robot_survey
from soilmoist_ros.pipeline.field_survey import open_survey
from soilmoist_ros.pipeline.properties import ReplayedProperty
from soilmoist_ros.pipeline.run import FailedRun, NoMapError, NoteCode
from soilmoist_ros.recording import CONFIGURATION, BagReader, BagWriter, MapRecords, write_parameters
from soilmoist_ros.recording.bag.scan import McapScan
from soilmoist_ros.recording.map_records import RECEIVED
from soilmoist_ros.reporting.outputs import write_failed
from soilmoist_ros.sensing.position.place_doubt import DOUBTS, Doubt, DoubtOutcome
from soilmoist_ros.sensing.records import CountRecord

GOLDEN = Path(__file__).resolve().parent.parent / "golden"
CASES = {
    "one_stop": {"replay": {}}, "drive_and_stop": {"replay": {}}, "no_position_gap": {"replay": {}},
    "was_reset": {"replay": {}}, "raw_lines": {"counts": {}},
    "two_robots": {"robot1": {"counts_topic": "/robot1/counts"}, "robot2": {"counts_topic": "/robot2/counts"}},
}  # fmt: skip
REPLAYS = [(case, name) for case, replays in CASES.items() for name in replays]


@pytest.fixture(scope="session")
def makers():
    pytest.importorskip("rclpy")
    spec = importlib.util.spec_from_file_location("make_golden_bags", GOLDEN / "make_golden_bags.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def bands(soil_map):
    return {name: getattr(soil_map, name) for name in ("rate", "rate_sd", "vwc", "vwc_sd")}


def with_files(case, **changes):
    """Settings equal to the configuration of a golden run."""
    folder = GOLDEN / case / "configuration"
    values = {"field": str(folder / "field.yaml"), "site": str(folder / "site.yaml"), "cell_m": 4.0, **changes}
    return ReplaySettings(**values)


@pytest.fixture
def edited_site(tmp_path):
    def edit(more="", **replaced):
        text = (GOLDEN / "raw_lines" / "configuration" / "site.yaml").read_text()
        lines = [line for line in text.splitlines() if line.partition(":")[0] not in replaced]
        lines += [f"{key}: {value}" for key, value in replaced.items()] + [more]
        path = tmp_path / "other_site.yaml"
        path.write_text("\n".join(lines) + "\n")
        return str(path)

    return edit


def require(run, expected):
    """Numbers, not bits: another processor rounds differently."""
    assert len(run.track) == expected["records"]
    assert len(run.soil_map.samples) == expected["samples"]
    assert run.soil_map.samples.counts.sum() == expected["raw_counts"]
    assert {row.kind: row.count for row in run.losses} == expected["lost"]
    for band, values in bands(run.soil_map).items():
        found = [np.nanmin(values), np.nanmean(values), np.nanmax(values)]
        assert found == pytest.approx(expected["bands"][band], rel=1e-5)
    assert run.simulated


@pytest.mark.parametrize(
    ("case", "name"),
    [pytest.param(*one, marks=() if one[0] == "raw_lines" else pytest.mark.slow) for one in REPLAYS],
)
def test_golden_bags(case, name):
    expected = json.loads((GOLDEN / case / "expected.json").read_text())[name]
    replay = replay_bag(GOLDEN / case, ReplaySettings(**CASES[case][name]))
    run = replay.run
    require(run, expected)
    if expected["as_on_line"]:
        assert re.search("bit for bit|rounding", replay.comparisons[0])
    else:
        # False: the robot's fit was that of an earlier version.
        begin = {False: "differs from", None: "not compared"}[expected["as_on_line"]]
        assert replay.comparisons[0].startswith(begin)
    mission = expected.get("mission")
    assert (run.mission is None) == (mission is None)
    if mission:
        assert run.mission.ended == mission["ended"]
        assert run.mission.series[-1].distance_m == pytest.approx(mission["distance_m"])
        found = [(visit.name, visit.arrived_s, visit.dwell_s, visit.raw_counts) for visit in run.mission.visits]
        assert found == [(name, pytest.approx(a), pytest.approx(d), n) for name, a, d, n in mission["visits"]]


@pytest.mark.slow
@pytest.mark.parametrize("case", ["one_stop", "no_position_gap", "drive_and_stop", "raw_lines"])
def test_the_map_is_the_one_made_on_line_bit_for_bit(makers, tmp_path, case):
    makers.CASES[case](tmp_path / case)
    replay = replay_bag(tmp_path / case)
    assert replay.comparisons == ["equals the robot's last one, bit for bit"]


@pytest.mark.slow
def test_the_mission_is_replayed_as_it_was(makers, tmp_path):
    events, mission = makers.mission()
    makers.write_bag(tmp_path / "run", events)
    run = replay_bag(tmp_path / "run", ReplaySettings(truths={"": "half-wet"})).run
    assert len(run.mission.visits) == len(mission.visits) > 4
    for found, wanted in zip(run.mission.visits, mission.visits, strict=True):
        assert (found.name, found.raw_counts) == (wanted.name, wanted.raw_counts)
        assert found.reason == wanted.reason
        assert (found.arrived_s, found.dwell_s) == pytest.approx((wanted.arrived_s, wanted.dwell_s), abs=1e-3)
        assert (found.x_m, found.y_m) == pytest.approx((wanted.x_m, wanted.y_m), abs=0.5)
    first, *_, last = run.mission.series
    assert (first.time_s, first.samples) == (0.0, 0)
    assert np.isnan(first.mse)
    assert [row.samples for row in run.mission.series[1:]] == list(range(1, len(mission.visits) + 1))
    # Places go through the message as 32-bit numbers.
    assert (last.mse, last.vwc_rmse, last.coverage95) == pytest.approx(
        (mission.series[-1].mse, mission.series[-1].vwc_rmse, mission.series[-1].coverage95), rel=1e-3
    )
    assert run.truth_rate is not None
    assert run.mission.settings.strategy == "greedy"
    assert run.mission.soil_map is run.soil_map


@pytest.mark.slow
def test_doubts_about_the_place_give_the_map_of_the_mapper(tmp_path):
    with BagReader(GOLDEN / "one_stop" / "bag") as reader:
        records = reader.read_counts()
        topic = reader.find_topic("counts", "sensor_msgs/msg/PointCloud2").replace("counts", DOUBTS)
    first, middle, last = records[0].stamp_s, records[len(records) // 2].stamp_s, records[-1].stamp_s
    stood = Doubt(middle - 35.0, middle, DoubtOutcome.RETURNED, 21.0, 22.0)
    doubts = [
        Doubt(first - 100.0), Doubt(first - 100.0, first + 25.0, DoubtOutcome.LOST), stood, Doubt(last - 5.0),
    ]  # fmt: skip
    bag = copy_bag(
        GOLDEN / "one_stop" / "bag", tmp_path / "bag", texts=[(topic, doubt.to_text()) for doubt in doubts],
        mcap=True,
    )  # fmt: skip
    replay = replay_bag(bag, with_files("one_stop"))
    live = MapRecords(FieldMap(FieldGrid.from_polygon([(-500, -500), (500, -500), (500, 500), (-500, 500)], 50.0)))
    live.take(RECEIVED, records)
    assert all(map(live.doubt, doubts))
    replayed = sorted([*replay.run.track, *replay.run.quarantined], key=lambda record: record.stamp_s)
    assert repr(replayed) == repr(live.map.track)
    assert {record.quarantine for record in replayed} == {"", "place_doubt"}
    assert any((record.x_m, record.y_m) == (21.0, 22.0) for record in replayed)


@pytest.mark.slow
def test_what_was_lost_is_noted(tmp_path):
    writer = BagWriter(tmp_path / "run")
    for message in McapScan(GOLDEN / "one_stop" / "bag" / "bag_0.mcap").messages():
        writer.write(message.topic, message.log_ns, message.publish_ns, message.data)
    writer.close({"messages of /counts lost on the way": "3"})
    replay = replay_bag(tmp_path / "run", with_files("one_stop"))
    assert replay.comparisons == replay_bag(GOLDEN / "one_stop").comparisons
    (note,) = [note for note in replay.run.notes if note.code is NoteCode.LOST_MESSAGES]
    assert note.message == "The recorder noted of run: messages of /counts lost on the way: 3."


@pytest.mark.slow
def test_it_is_not_compared_with_a_map_of_other_records(tmp_path):
    cases = {
        "began": (lambda topic, number: topic != "/counts" or number > 2, "of other records than the bag"),
        "unheard": (lambda topic, number: topic != "/counts" or number < 9, "of other records than the bag"),
        "no_map": (lambda topic, number: topic != "/soil_map", "the bag has no map"),
    }
    for name, (keep, why) in cases.items():
        replay = replay_bag(copy_bag(GOLDEN / "one_stop" / "bag", tmp_path / name, keep), with_files("one_stop"))
        assert re.match(f"not compared: .*{why}", replay.comparisons[0])


@pytest.mark.slow
def test_a_reset_is_detected(makers, tmp_path):
    """The recording contains the empty map."""
    many = makers.records(makers.drive((5, 5), (55, 5), 12))
    makers.configure(tmp_path)
    with makers.BagWriter(tmp_path / "bag") as writer:
        robot = makers.Robot(writer, tmp_path)
        for number, event in enumerate([*many[:6], None, None, *many[6:], None]):
            if number == 7:
                robot.online.reset()
            robot.publish(event)
    (compared,) = replay_bag(tmp_path / "bag").comparisons
    assert re.match("not compared: .* it was reset", compared)


def test_other_corrections_need_the_raw_lines(edited_site):
    site = edited_site(corrections="{pressure: {reference_hpa: 950.0}}")
    own = replay_bag(GOLDEN / "raw_lines").run
    counts = replay_bag(GOLDEN / "raw_lines", ReplaySettings(site=site)).run
    np.testing.assert_array_equal(own.soil_map.rate, counts.soil_map.rate)
    assert [note.code for note in counts.notes] == [NoteCode.OTHER_CORRECTIONS]
    assert next(row for row in counts.corrections if "pressure" in row.name).parameters["P0 [hPa]"] == 1013.25

    run = GOLDEN / "raw_lines"
    files = {"field": run / "configuration" / "field.yaml", "cell_m": 4.0, "noise": "local", "drift_model": "off"}
    raw = map_logs([run], MapSettings(**files, site=run / "configuration" / "site.yaml"))
    require(raw, json.loads((GOLDEN / "raw_lines" / "expected.json").read_text())["raw"])
    lines = map_logs([run], MapSettings(**files, site=site)).track
    factor = np.exp(0.0077 * (1013.25 - 950.0))
    np.testing.assert_allclose([one.f_pressure for one in lines], [one.f_pressure * factor for one in own.track])


@pytest.mark.slow
def test_topics_of_another_namespace_are_found_where_there_is_one_robot(tmp_path):
    """Records that were remapped into a separate namespace."""
    names = lambda topic: ["/sensor/counts" if topic == "/counts" else topic]  # noqa: E731
    bag = copy_bag(GOLDEN / "one_stop" / "bag", tmp_path / "bag", names=names)
    assert replay_bag(bag, with_files("one_stop")).comparisons == replay_bag(GOLDEN / "one_stop").comparisons


@pytest.mark.slow
def test_the_robot_s_own_records_are_meant_where_another_sensor_s_are_below(tmp_path):
    bag = copy_bag(
        GOLDEN / "two_robots" / "bag", tmp_path / "bag",
        names=lambda topic: [topic.replace("/robot1/", "/").replace("/robot2/", "/compaction/")],
    )  # fmt: skip
    for given, meant in (("counts", "/robot1/counts"), ("/compaction/counts", "/robot2/counts")):
        own = replay_bag(bag, with_files("two_robots", counts_topic=given)).run.track
        assert list(own) == list(replay_bag(GOLDEN / "two_robots", ReplaySettings(counts_topic=meant)).run.track)


@pytest.mark.slow
def test_bad_input_is_refused_with_a_remedy(tmp_path):
    def refused(match, bag=GOLDEN / "one_stop", **changes):
        with pytest.raises(InputError, match=match):
            replay_bag(bag, ReplaySettings(**changes))

    nothing = copy_bag(GOLDEN / "one_stop" / "bag", tmp_path / "a" / "nothing", lambda topic, number: False)
    refused(r"does not say which field it is of -> give the field file with --field", nothing)
    refused("no map: The sensor sent no record that could be used", nothing, field="example")
    refused("has no topic 'records'", counts_topic="records")
    refused("there is no such bag", tmp_path / "none")
    refused(
        r"no map: All 14 records lie at least 31 km north .* of the field 'Elsewhere'", field=other_field(tmp_path)
    )
    refused("there is no model 'linear' -> choose one of: .*matern32", model="linear")
    refused("there is no fit 'ols'", fit="ols")
    refused("radius_m must be >= 0", merge_radius_m=-1.0)
    refused("cannot be gridded", cell_m=900.0)
    refused("half-wat", truths={"": "half-wat"})


def other_field(folder):
    path = folder / "elsewhere.yaml"
    path.write_text(
        "name: Elsewhere\ndatum: {latitude_deg: 53.0, longitude_deg: -0.5}\n"
        "polygon: [[5000, 0], [5060, 0], [5060, 50], [5000, 50]]\n"
    )
    return str(path)


def failure(bag, settings=None):
    with pytest.raises(NoMapError) as caught:
        replay_bag(bag, settings or ReplaySettings())
    return caught.value.failed


@pytest.fixture(scope="module")
def silent(tmp_path_factory):
    """A mission whose sensor never sent a record."""
    run = tmp_path_factory.mktemp("silent")
    shutil.copytree(GOLDEN / "drive_and_stop" / "configuration", run / "configuration")
    bag = GOLDEN / "drive_and_stop" / "bag"
    copy_bag(bag, run / "bag", lambda topic, _: topic != "/counts", mcap=True)
    return run


def test_a_mission_whose_sensor_was_silent(silent, tmp_path):
    failed = failure(silent)
    assert failed.why.startswith("The sensor sent no record that could be used")
    assert "The mission ended after" in failed.why
    assert "soilmoist check --logger" in failed.todo[0]
    assert failed.mission is not None
    assert failed.mission.log
    assert not failed.track
    names = [path.name for path in write_failed(tmp_path, failed)]
    assert names == ["summary.json", "report.html", "records.csv", "series.csv", "visits.csv"]
    assert "Log of the mission" in (tmp_path / "report.html").read_text()


def test_too_few_samples_are_the_cause():
    failed = failure(GOLDEN / "one_stop", ReplaySettings(fit="soft_l1"))
    assert failed.why == "14 records at 1 place: there are too few samples for a map."
    assert len(failed.track) == 14


def test_quarantined_records_are_the_cause():
    bad = dataclasses.replace(CountRecord(1.78e9, 1.0, 2.0, 0.0, 900, 10.0, 9.0), quarantine="noisy_tube")
    worse = dataclasses.replace(bad, quarantine="impossible_count")
    survey = open_survey(str(GOLDEN / "one_stop" / "configuration" / "field.yaml"))
    first = ReplayedProperty("moisture", 1.0, survey, [bad, worse, bad], [], None, None)
    run = FailedRun("", (), datetime.now(UTC))
    failed = no_map._no_map(GOLDEN / "one_stop" / "bag", first, None, run).failed
    assert failed.why == "All 3 records are quarantined: tube counts too much (2), impossible count (1)."
    assert failed.quarantined == {"noisy_tube": 2, "impossible_count": 1}


def test_faults_that_nodes_reported_are_counted_errors_first(tmp_path):
    header = STORE.types["std_msgs/msg/Header"](STORE.types["builtin_interfaces/msg/Time"](0, 0), "")

    def diagnostics(*statuses):
        found = [STORE.types[STATUS](level, name, text, "", []) for name, level, text in statuses]
        return STORE.serialize_cdr(STORE.types[no_map.DIAGNOSTICS](header, found), no_map.DIAGNOSTICS)

    with Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        topic = writer.add_connection("/diagnostics", no_map.DIAGNOSTICS, typestore=STORE)
        writer.write(topic, 1, diagnostics(("driver", 1, "old"), ("mapper", 0, "fine")))
        writer.write(topic, 2, diagnostics(("driver", 1, "old"), ("logger", 2, "wrong checksum")))
    found = no_map.read_troubles(tmp_path / "bag")
    assert [(one.name, one.message, one.count, one.error) for one in found] == [
        ("logger", "wrong checksum", 1, True),
        ("driver", "old", 2, False),
    ]


@pytest.fixture
def may(tmp_path):
    """The output folder of an earlier survey of a simulated field, which names its property."""
    return run_folder(tmp_path / "may", records(1, MAY_S), properties=[{"name": "smooth"}])


def test_a_replay_has_the_earlier_runs_of_the_robot_unless_it_is_given_others(tmp_path, may):
    write_parameters(tmp_path, "mapper", {"field": "smooth", "model": "matern32", "earlier": [str(may)]})
    bag, configuration = tmp_path / "bag", tmp_path / CONFIGURATION
    of_robot, _ = robot_survey(bag, configuration, ReplaySettings())
    assert [run.survey.name for run in of_robot.earlier] == ["may"]
    assert of_robot.map.knowledge.earlier == (of_robot.earlier[0].survey,)
    without, _ = robot_survey(bag, configuration, ReplaySettings(earlier=()))
    assert without.map.knowledge.earlier == ()
