import json

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from soilmoist_ros.exploration.mission.journal import MissionJournal
from soilmoist_ros.exploration.mission.mission import Mission
from soilmoist_ros.exploration.mission.types import Command, MissionRules, Moved, RecordArrived, Verb
from soilmoist_ros.exploration.planning.dwell import parse_dwell
from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.mapping.field_map import Skip
from soilmoist_ros.recording.journal import Journal
from soilmoist_ros.replay.online_survey import open_survey, read_earlier
from soilmoist_ros.sensing.records import NAN, CountRecord

CLOUD = "sensor_msgs/msg/PointCloud2"
COLUMNS = (
    "x",
    "y",
    "z",
    "raw_counts",
    "exposure_s",
    "effective_exposure_s",
    "f_pressure",
    "f_humidity",
    "f_intensity",
)


def records(n=8):
    rng = np.random.default_rng(5)
    places = rng.uniform((2, 2), (58, 48), (n, 2)).astype(np.float32).tolist()
    return [
        CountRecord(1.78e9 + i, x, y, 30.0, int(rng.poisson(400)), 100.0, 95.0) for i, (x, y) in enumerate(places)
    ]


def filled(many, **options):
    survey = open_survey("example", "example", **options)
    for record in many:
        survey.online.add(record)
    return survey


def write_bag(folder, many):
    """A bag of the records as the topic ``counts`` has them."""
    store = get_typestore(Stores.ROS2_JAZZY)
    types = store.types
    layout = np.dtype(
        [(name, "<f4" if name in "xyz" else "<u4" if name == "raw_counts" else "<f8") for name in COLUMNS]
    )
    datatype = {"<f4": 7, "<f8": 8, "<u4": 6}
    fields = [
        types["sensor_msgs/msg/PointField"](name, layout.fields[name][1], datatype[layout[name].str], 1)
        for name in COLUMNS
    ]
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        topic = writer.add_connection("/counts", CLOUD, typestore=store)
        for one in many:
            stamp = types["builtin_interfaces/msg/Time"](int(one.stamp_s), 0)
            row = (
                one.x_m,
                one.y_m,
                one.z_m,
                one.raw_counts,
                one.exposure_s,
                one.effective_exposure_s,
                1.0,
                1.0,
                1.0,
            )
            data = np.frombuffer(np.array([row], layout).tobytes(), "u1")
            header = types["std_msgs/msg/Header"](stamp, "map")
            cloud = types[CLOUD](header, 1, 1, fields, False, layout.itemsize, layout.itemsize, data, True)
            writer.write(topic, int(one.stamp_s * 1e9), store.serialize_cdr(cloud, CLOUD))


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    folder = tmp_path_factory.mktemp("saved")
    survey = filled([*records(), CountRecord(1.78e9, NAN, NAN, NAN, 400, 100.0, 95.0)], simulated=True)
    survey.online.skip(Skip.UNREADABLE, "too short")
    return survey, folder, survey.save(folder, survey.online.snapshot())


def test_what_is_saved_tells_the_whole_story(saved):
    _, folder, written = saved
    assert {path.name for path in written} == {path.name for path in folder.iterdir()}
    summary = json.loads((folder / "summary.json").read_text())
    assert (summary["n_records"], summary["n_placed_records"], summary["n_samples"]) == (9, 8, 8)
    assert summary["n_lost"] == {"no position": 1, "unreadable message": 1}
    assert (summary["site"], summary["field"], summary["simulated"]) == ("Example site", "Example field", True)
    assert [item["role"] for item in summary["inputs"]] == ["field", "site"]
    assert summary["calibration"]["n0_cps"] == 6.0


def test_a_map_can_start_from_what_was_saved_or_from_a_bag(saved, tmp_path):
    survey, folder, _ = saved
    write_bag(tmp_path / "bag", records())
    expected = survey.online.compute(survey.online.state)
    for source in (folder, tmp_path / "bag"):
        again = filled(read_earlier(source))
        found = again.online.compute(again.online.state)
        for band, wanted in zip(found.bands, expected.bands, strict=True):
            assert band.tobytes() == wanted.tobytes()
    with pytest.raises(InputError, match=r"no topic '/salt/counts'.*/counts "):
        read_earlier(tmp_path / "bag", "salt")


def test_an_interrupted_mission_gives_its_records(tmp_path):
    mission = Mission(MissionRules(budget_s=3600.0, dwell=parse_dwell("fmi:60")))
    events = [Moved(1.77e9, 0.0, 0.0), Command(1.78e9, Verb.START)]
    events += [RecordArrived(r.stamp_s, r) for r in records()]
    with Journal.open(tmp_path) as pages:
        journal = MissionJournal(pages)
        for event in events:
            journal.note(mission, event)
            mission.step(event)
            journal.keep(mission)
        journal.note_beside("/salt", 1.78e9 + 1.0, records()[2])
    assert read_earlier(tmp_path) == records()
    assert read_earlier(tmp_path, "/salt") == records()[2:3]
    assert read_earlier(tmp_path, "clay") == []


def test_other_folders_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"neither records.csv nor a bag nor a journal.*saved, a bag"):
        read_earlier(tmp_path)
    with pytest.raises(InputError, match="there is no such bag"):
        read_earlier(tmp_path / "none")


def test_options_reach_the_map():
    survey = filled(
        records(), cell_m=5.0, model="spherical", fit="soft_l1", keep_nugget=False, merge_radius_m=100.0
    )
    assert survey.online.grid.cell_m == 5.0
    assert len(survey.online.state.samples) == 1
    with pytest.raises(InputError, match="there are not samples enough for a map"):
        survey.run(survey.online.snapshot())
    survey = filled(records(), model="spherical", fit="soft_l1", keep_nugget=False)
    assert survey.online.grid.cell_m == 0.5  # the field's own
    run = survey.run(survey.online.snapshot())
    assert run.soil_map.variogram.model == "spherical"
    assert run.soil_map.fit.method == "soft_l1"
    assert not run.soil_map.kriging.keep_nugget
    assert run.settings["nugget"] == "filtered"


def test_without_a_site_there_is_a_rate_map():
    survey = open_survey("example")
    for record in records():
        survey.online.add(record)
    run = survey.run(survey.online.snapshot())
    assert run.title == "Neutron count rate map"
    assert np.isnan(run.soil_map.vwc).all()


def test_mistakes_are_told_with_a_remedy():
    with pytest.raises(InputError, match=r"did you mean 'example'\?"):
        open_survey("exampel")
    with pytest.raises(InputError, match=r"cannot be gridded: .*change the cell size"):
        open_survey("example", cell_m=500.0)


def test_only_a_site_that_says_so_deconvolves_the_footprint(tmp_path):
    site = tmp_path / "site.yaml"
    for text, radius_m in (
        ("footprint_radius_m: 8\n", 0.0),
        ("footprint_radius_m: 8\ndeconvolve_footprint: true\n", 8.0),
        ("deconvolve_footprint: true\n", 10.0),
    ):
        site.write_text(text)
        online = open_survey("example", str(site)).online
        assert online.settings.footprint_radius_m == radius_m
        online.add(CountRecord(1.78e9, *online.grid.cells[0].tolist(), 30.0, 400, 100.0, 95.0))
        np.testing.assert_array_equal(online.state.samples.spread, [[radius_m**2 / 4, 0, radius_m**2 / 4]])
    assert open_survey("example").online.settings.footprint_radius_m == 0
