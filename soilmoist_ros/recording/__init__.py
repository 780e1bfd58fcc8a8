# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Runs on disk: bags in the rosbag2 layout that survive a crash, the mission's journal, and the folder of a run.

>>> from pathlib import Path
>>> from tempfile import mkdtemp
>>> from soilmoist_ros.recording import Journal, load_journal
>>> folder = Path(mkdtemp())
>>> with Journal.open(folder) as journal:
...     number = journal.append("event", {"verb": "start"})
>>> load_journal(folder).entries
(Entry(seq=1, kind='event', payload={'verb': 'start'}),)
"""

from typing import TYPE_CHECKING

from soilmoist_ros.foundation import open_door

if TYPE_CHECKING:
    # fmt: off
    from soilmoist_ros.recording.bag.info import info_table as info_table, plain_text as plain_text, print_plain as print_plain, verified_table as verified_table
    from soilmoist_ros.recording.bag.messages import CLOUD as CLOUD, COUNT_DATUM as COUNT_DATUM, COUNT_POINT as COUNT_POINT, DATATYPES as DATATYPES, FRAME as FRAME, QUARANTINED as QUARANTINED, REASON as REASON, SAMPLE_AREA as SAMPLE_AREA, SAMPLE_SPREAD as SAMPLE_SPREAD, VISIT as VISIT, count_points as count_points, count_records as count_records, line_bytes as line_bytes, line_text as line_text, points as points, quarantined_topic as quarantined_topic, sample_points as sample_points, stamp_parts as stamp_parts, visit_of as visit_of, visit_values as visit_values
    from soilmoist_ros.recording.bag.metadata import Qos as Qos, Request as Request, Topic as Topic, find_definition as find_definition, request_for as request_for
    from soilmoist_ros.recording.bag.plain_topics import PlainTopics as PlainTopics
    from soilmoist_ros.recording.bag.playback import INPUTS as INPUTS, Pacer as Pacer, Playback as Playback, TopicChoice as TopicChoice
    from soilmoist_ros.recording.bag.reader import BagReader as BagReader, bags_of as bags_of
    from soilmoist_ros.recording.bag.recorder import BagRecorder as BagRecorder, check_name as check_name, free_bytes as free_bytes, next_bag as next_bag, recorder_health as recorder_health
    from soilmoist_ros.recording.bag.storage import recorder_notes as recorder_notes
    from soilmoist_ros.recording.bag.verify import bag_info as bag_info, recover_bag as recover_bag
    from soilmoist_ros.recording.bag.writer import BagWriter as BagWriter
    from soilmoist_ros.recording.journal import Journal as Journal, load_journal as load_journal
    from soilmoist_ros.recording.map_records import START as START, TEAM_S as TEAM_S, MapRecords as MapRecords, record_key as record_key
    from soilmoist_ros.recording.map_sources import DRIVER as DRIVER, MapSources as MapSources, RecordLog as RecordLog
    from soilmoist_ros.recording.run_folder import CONFIGURATION as CONFIGURATION, SUMMARY as SUMMARY, RunConfiguration as RunConfiguration, bag_of as bag_of, configuration_of as configuration_of, copy_configuration as copy_configuration, is_bag as is_bag, message_files as message_files, read_parameters as read_parameters, sync_file as sync_file, sync_folder as sync_folder, write_parameters as write_parameters, write_whole as write_whole
    from soilmoist_ros.recording.stored_mission import StoredMission as StoredMission
    from soilmoist_ros.recording.stored_records import COLUMNS as COLUMNS, RECORDS as RECORDS, read_earlier as read_earlier, read_records as read_records, write_records as write_records
    # fmt: on

__getattr__, __dir__, __all__ = open_door(
    __name__,
    {
        "bag.info": "info_table plain_text print_plain verified_table",
        "bag.messages": "CLOUD COUNT_DATUM COUNT_POINT DATATYPES FRAME QUARANTINED REASON SAMPLE_AREA SAMPLE_SPREAD VISIT count_points count_records line_bytes line_text points quarantined_topic sample_points stamp_parts visit_of visit_values",
        "bag.metadata": "Qos Request Topic find_definition request_for",
        "bag.plain_topics": "PlainTopics",
        "bag.playback": "INPUTS Pacer Playback TopicChoice",
        "bag.reader": "BagReader bags_of",
        "bag.recorder": "BagRecorder check_name free_bytes next_bag recorder_health",
        "bag.storage": "recorder_notes",
        "bag.verify": "bag_info recover_bag",
        "bag.writer": "BagWriter",
        "journal": "Journal load_journal",
        "map_records": "MapRecords START TEAM_S record_key",
        "map_sources": "DRIVER MapSources RecordLog",
        "run_folder": "CONFIGURATION RunConfiguration SUMMARY bag_of configuration_of copy_configuration is_bag message_files read_parameters sync_file sync_folder write_parameters write_whole",
        "stored_mission": "StoredMission",
        "stored_records": "COLUMNS RECORDS read_earlier read_records write_records",
    },
)
