# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The mapper as a real process, also for several robots."""

from __future__ import annotations

import csv
import json
import signal
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("rclpy")
from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import OccupancyGrid
from sensor_msgs.msg import PointCloud2
from soilmoist_msgs.msg import Mission
from std_msgs.msg import String
from std_srvs.srv import Trigger

from msg_adapters.counts import counts_from_message, counts_to_message, samples_from_message
from msg_adapters.environment import diagnostics_from_message
from msg_adapters.model import model_from_message
from msg_adapters.point_cloud import FRAME, to_seconds
from msg_adapters.soil_map import soil_map_from_message
from soilmoist_ros.mapping import FieldMap, map_cells
from soilmoist_ros.nodes.topics import DEFAULT, LATCHED, RECORDS
from soilmoist_ros.pipeline import open_survey
from soilmoist_ros.reporting import write_outputs
from soilmoist_ros.sensing.records import NAN, CountRecord

BEGIN_S = 1.78e9
FIELD = """
name: Test field
datum: {latitude_deg: 53.268, longitude_deg: -0.5245}
polygon: [[0, 0], [60, 0], [60, 50], [0, 50]]
no_go: [[[25, 20], [30, 20], [30, 26], [25, 26]]]
cell_m: 2
"""


def record(number, x_m, y_m, counts=40, **changes):
    values = {"exposure_s": 10.0, "effective_exposure_s": 9.5, "f_pressure": 10 / 9.5, **changes}
    return CountRecord(BEGIN_S + 10 * number, x_m, y_m, 30.0, counts, **values)


def survey_records(n=24, seed=3):
    rng = np.random.default_rng(seed)
    stops = rng.uniform((2, 2), (58, 48), (-(-n // 4), 2))
    return [
        record(
            i,
            *(stops[i // 4] + rng.normal(0, 0.2, 2)).tolist(),
            counts=int(rng.poisson(38 + stops[i // 4][0] / 5)),
        )
        for i in range(n)
    ]


class Outputs:
    """Messages of the mapper that the observer receives."""

    def __init__(self, ros):
        self.samples = ros.collect(PointCloud2, "samples", LATCHED)
        self.model = ros.collect(String, "model", LATCHED)
        self.soil_map = ros.collect(PointCloud2, "soil_map", LATCHED)
        self.uncertainty = ros.collect(OccupancyGrid, "uncertainty", LATCHED)

    def complete(self, stamp_s):
        """Whether the last messages of all topics belong to the map that ends with the record of this time."""
        if not (self.samples and self.model and self.soil_map and self.uncertainty):
            return False
        stamps = [to_seconds(last[-1].header.stamp) for last in (self.samples, self.soil_map, self.uncertainty)]
        return {*stamps, model_from_message(self.model[-1]).stamp_s} == {stamp_s}


@pytest.fixture
def field(tmp_path):
    path = tmp_path / "field.yaml"
    path.write_text(FIELD)
    return path


@pytest.fixture
def start(ros, field, tmp_path):
    def make(**params):
        site = params.pop("site", "example")
        # Without a clock, no stamp is impossible: the tests do not depend on the date.
        params = {
            "field": str(field), "site": site, "save_dir": str(tmp_path / "saved"), "use_sim_time": True, **params,
        }  # fmt: skip
        process = ros.start("mapper", params=params)
        publisher = ros.node.create_publisher(PointCloud2, "counts", RECORDS)
        ros.wait_for(publisher.get_subscription_count, message="the mapper")
        return process, publisher

    return make


def publish(publisher, records):
    for one in records:
        publisher.publish(counts_to_message([one]))


def on_line(field, records, **options):
    """The core after records that were converted to messages and back."""
    return surveyed(field, records, **options).map


def surveyed(field, records, site="example", **options):
    survey = open_survey(str(field), site, **options)
    for one in records:
        survey.map.add(counts_from_message(counts_to_message([one]))[0])
    return survey


def test_maps_are_those_of_the_core_bit_for_bit_until_a_reset(ros, start, field):
    records = survey_records()
    outputs = Outputs(ros)
    _, publisher = start()
    publish(publisher, records)
    ros.wait_for(lambda: outputs.complete(records[-1].stamp_s), message="the last map")
    core = on_line(field, records)
    soil_map = core.compute(core.state)
    message = outputs.soil_map[-1]
    assert message.header.frame_id == FRAME
    assert (message.height, message.width) == core.grid.shape == (25, 30)
    assert soil_map_from_message(message).tobytes() == map_cells(core.grid, soil_map).tobytes()
    np.testing.assert_array_equal(np.isnan(soil_map_from_message(message)["vwc"]), ~core.grid.mask)
    samples = samples_from_message(outputs.samples[-1])
    assert len(samples) == 6
    np.testing.assert_array_equal(samples.counts, core.state.samples.counts)
    fit = model_from_message(outputs.model[-1]).fit
    assert fit.variogram == soil_map.variogram
    assert json.loads(outputs.model[-1].data)["n_samples"] == 6
    np.testing.assert_array_equal(np.array(outputs.uncertainty[-1].data) < 0, ~core.grid.mask.ravel())
    late = Outputs(ros)
    ros.wait_for(lambda: late.complete(records[-1].stamp_s), message="latched topics")
    assert len(late.soil_map) == 1

    answer = ros.call(Trigger, "mapper/reset")
    assert (answer.success, answer.message) == (True, "24 records removed")
    ros.wait_for(lambda: outputs.complete(0.0), message="the empty map")
    late = Outputs(ros)
    ros.wait_for(lambda: late.complete(0.0), message="the empty map")
    assert len(samples_from_message(late.samples[-1])) == 0
    assert model_from_message(late.model[-1]).fit is None
    assert np.isnan(soil_map_from_message(late.soil_map[-1])["rate"]).all()
    assert set(late.uncertainty[-1].data) == {-1, 100}
    publish(publisher, records[:1])
    ros.wait_for(lambda: outputs.complete(records[0].stamp_s))
    assert len(samples_from_message(outputs.samples[-1])) == 1


def test_a_planner_has_the_map_of_the_mapper_when_the_rate_drifts(ros, start, field):
    """Three passes over the same stops, with the jitter of a receiver."""
    rng = np.random.default_rng(4)
    stops = [(x, y) for x in range(5, 60, 10) for y in range(5, 50, 10)]
    records = [
        record(
            12 * number, *(stops[number % 30] + rng.normal(0, 0.2, 2)).tolist(),
            int(rng.poisson(300 + 60 * np.sin(stops[number % 30][0] / 12) + 0.8 * number)), exposure_s=100.0,
            effective_exposure_s=95.0, f_pressure=100 / 95,
        )
        for number in range(90)
    ]  # fmt: skip
    outputs = Outputs(ros)
    _, publisher = start()
    publisher.publish(counts_to_message(records))
    ros.wait_for(lambda: outputs.complete(records[-1].stamp_s), message="the last map")
    core = on_line(field, records)
    soil_map = core.compute(core.state)
    assert soil_map.change.drift is not None
    model = model_from_message(outputs.model[-1])
    assert model.changing.change.drift == soil_map.change.drift
    planner = FieldMap(core.grid)
    planner.set_samples(samples_from_message(outputs.samples[-1]), model.fit, model.changing)
    planned = planner.update()
    np.testing.assert_array_equal(planned.rate, soil_map.rate)
    np.testing.assert_array_equal(planned.variance, soil_map.variance)


def test_bad_records_do_no_harm_and_are_counted_by_reason(ros, start):
    good = survey_records(4)
    outputs = Outputs(ros)
    _, publisher = start()
    health = ros.collect(DiagnosticArray, "/diagnostics", DEFAULT)
    publish(publisher, good[:3])
    broken = counts_to_message([good[0]])
    broken.data = broken.data[:-4]
    for message in (PointCloud2(), broken, PointCloud2(height=3, width=4_000_000_000, point_step=1)):
        publisher.publish(message)
    publisher.publish(counts_to_message([record(9, 5.0, 5.0)], "odom"))
    bad = [
        record(10, NAN, NAN),
        record(11, 500.0, 10.0),
        record(12, 5.0, 5.0, effective_exposure_s=-1.0),
        record(13, 5.0, 5.0, counts=4_000_000_000),
        replace(record(14, 5.0, 5.0), stamp_s=0.0),
    ]
    publish(publisher, [*bad, good[3]])
    ros.wait_for(lambda: outputs.complete(good[3].stamp_s))

    def values():
        found = [part for message in health for part in diagnostics_from_message(message) if "mapper" in part.name]
        return found[-1].values if found else {}

    ros.wait_for(lambda: values().get("records skipped") == "9", message=f"skipped records in {values()}")
    assert {key: value for key, value in values().items() if key.startswith("skipped")} == {
        "skipped: unreadable message": "3",
        "skipped: no position": "1",
        "skipped: outside the field": "1",
        "skipped: implausible record": "2",
        "skipped: other frame": "1",
        "skipped: impossible stamp": "1",
    }
    assert values()["samples"] == "1"
    assert samples_from_message(outputs.samples[-1]).counts.sum() == sum(one.raw_counts for one in good)


def test_save_writes_the_outputs_and_a_later_mapper_starts_from_them(ros, start, tmp_path):
    import rasterio

    records = [*survey_records(16), record(16, NAN, NAN)]
    outputs = Outputs(ros)
    process, publisher = start()
    empty = ros.call(Trigger, "mapper/save")
    assert not empty.success
    assert "too few samples" in empty.message
    publish(publisher, records)
    ros.wait_for(lambda: outputs.complete(records[-2].stamp_s))
    answer = ros.call(Trigger, "mapper/save")
    assert (answer.success, answer.message) == (True, str(tmp_path / "saved"))
    names = {path.name for path in (tmp_path / "saved").iterdir()}
    assert names == {"map.tif", "samples.geojson", "report.html", "summary.json", "records.csv", "soilmoist.qgs"}
    with rasterio.open(tmp_path / "saved" / "map.tif") as tif:
        assert {"vwc", "vwc_sd", "rate", "rate_sd"} <= set(tif.descriptions)
        assert np.isfinite(tif.read(1, masked=True).compressed()).sum() > 500
    summary = json.loads((tmp_path / "saved" / "summary.json").read_text())
    assert (summary["n_records"], summary["n_samples"], summary["n_lost"]) == (17, 4, {"no position": 1})
    assert (summary["field"], summary["simulated"]) == ("Test field", False)
    with (tmp_path / "saved" / "records.csv").open() as table:
        assert len(list(csv.reader(table))) == 18
    assert process.stop() == 0

    map_before = soil_map_from_message(outputs.soil_map[-1])
    again = Outputs(ros)
    start(start_from=str(tmp_path / "saved"))
    ros.wait_for(lambda: again.complete(records[-2].stamp_s), message="the map of the earlier records")
    assert soil_map_from_message(again.soil_map[-1]).tobytes() == map_before.tobytes()


def test_an_earlier_survey_informs_the_map_and_the_report_names_it(ros, field, start, tmp_path):
    before = open_survey(str(field), "example")
    for one in survey_records(48, seed=7):
        before.map.add(replace(one, stamp_s=one.stamp_s - 7 * 86400))
    write_outputs(tmp_path / "may", before.run(before.map.snapshot()))
    records, outputs = survey_records(16), Outputs(ros)
    _, publisher = start(earlier=[str(tmp_path / "may")])
    publish(publisher, records)
    ros.wait_for(lambda: outputs.complete(records[-1].stamp_s))
    core = on_line(field, records, earlier=[tmp_path / "may"])
    of_core = core.compute(core.state)
    rate = soil_map_from_message(outputs.soil_map[-1])["rate"]
    np.testing.assert_array_equal(rate.reshape(of_core.rate.shape), of_core.rate.astype(np.float32))
    answer = ros.call(Trigger, "mapper/save")
    assert answer.success
    summary = json.loads((tmp_path / "saved" / "summary.json").read_text())
    assert [one["name"] for one in summary["earlier"]] == ["may"]
    assert summary["change"]["since"] == "may"
    assert (tmp_path / "saved" / "change.tif").is_file()


def test_the_map_of_a_property_is_of_the_field_that_is_chosen_at_its_planner(ros, field, tmp_path):
    chosen = tmp_path / "chosen.yaml"
    chosen.write_text(field.read_text().replace("Test field", "Chosen field"))
    params = {"field": str(field), "start_property": "salt"}
    mapper = ros.start("mapper", params=params, namespace="/r1/salt")
    states = ros.node.create_publisher(Mission, "/r1/mission_state", LATCHED)
    states.publish(Mission(field=str(chosen)))
    ros.wait_for(lambda: "the map is of Chosen field now" in mapper.output())
    states.publish(Mission(field=str(tmp_path / "gone.yaml")))
    ros.wait_for(lambda: "the map is still of" in mapper.output())
    assert mapper.stop() == 0


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_a_save_that_a_signal_meets_is_finished_or_leaves_the_one_before(ros, start, tmp_path, number):
    records, folder = survey_records(24), tmp_path / "saved"
    outputs = Outputs(ros)
    process, publisher = start()
    publish(publisher, records[:16])
    ros.wait_for(lambda: outputs.complete(records[15].stamp_s))
    assert ros.call(Trigger, "mapper/save").success
    publish(publisher, records[16:])
    ros.wait_for(lambda: outputs.complete(records[-1].stamp_s))
    client = ros.node.create_client(Trigger, "mapper/save")
    ros.wait_for(client.service_is_ready)
    saving = client.call_async(Trigger.Request())
    ros.wait_for(lambda: saving.done() or any(folder.glob(".writing-*")), message="a save")
    code = process.stop(number)
    summary = json.loads((folder / "summary.json").read_text())
    with (folder / "records.csv").open() as table:
        rows = len(list(csv.reader(table))) - 1
    if number == signal.SIGKILL:
        assert summary["n_records"] in (16, 24)
        assert rows in (16, 24)
    else:
        assert (code, summary["n_records"], rows) == (0, 24, 24)
    assert (folder / "map.tif").stat().st_size > 1000
    assert (folder / "report.html").read_text().rstrip().endswith("</html>")


def test_records_about_another_datum_and_robots_in_one_namespace_are_named_and_not_mapped(ros, field):
    said = ros.collect(DiagnosticArray, "/diagnostics")
    params = {"field": str(field), "site": "example", "use_sim_time": True, "others": ["/robot_1", "/robot_2"]}
    process = ros.start("mapper", params=params, namespace="/robot_1")
    publishers = {
        name: ros.node.create_publisher(PointCloud2, f"{name}/counts", RECORDS)
        for name in ("/robot_1", "/robot_2")
    }
    for publisher in publishers.values():
        ros.wait_for(publisher.get_subscription_count)
    here, there = (53.268, -0.5245), (53.368, -0.5245)
    records = survey_records(8)
    for number, one in enumerate(records):
        publishers["/robot_1"].publish(counts_to_message([one], datum=here))
        publishers["/robot_2"].publish(counts_to_message([replace(one, x_m=1.0 + number)], datum=there))
    own = ros.node.create_publisher(PointCloud2, "/robot_1/counts", RECORDS)

    def values(name):
        found = [status for message in said for status in message.status if status.name.endswith(name)]
        return (found[-1].message, {each.key: each.value for each in found[-1].values}) if found else ("", {})

    ros.wait_for(lambda: values(": map")[1].get("skipped: other frame") == "8", message="records are left out")
    assert values(": map")[1]["records"] == "8"
    assert "another datum (53.368000 N, 0.524500 W, 11 km away)" in values(": map")[1]["last skipped: other frame"]
    ros.wait_for(
        lambda: "several nodes publish /robot_1/counts" in values(": others")[0], message=process.output()
    )
    ros.node.destroy_publisher(own)
