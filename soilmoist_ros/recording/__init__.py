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
    from soilmoist_ros.recording.bag.info import info_table as info_table
    from soilmoist_ros.recording.bag.info import plain_text as plain_text
    from soilmoist_ros.recording.bag.info import print_plain as print_plain
    from soilmoist_ros.recording.bag.info import recovery_table as recovery_table
    from soilmoist_ros.recording.bag.info import verified_table as verified_table
    from soilmoist_ros.recording.bag.messages import COUNT_DATUM as COUNT_DATUM
    from soilmoist_ros.recording.bag.messages import COUNT_POINT as COUNT_POINT
    from soilmoist_ros.recording.bag.messages import DATATYPES as DATATYPES
    from soilmoist_ros.recording.bag.messages import FRAME as FRAME
    from soilmoist_ros.recording.bag.messages import QUARANTINED as QUARANTINED
    from soilmoist_ros.recording.bag.messages import REASON as REASON
    from soilmoist_ros.recording.bag.messages import REASONS as REASONS
    from soilmoist_ros.recording.bag.messages import SAMPLE_POINT as SAMPLE_POINT
    from soilmoist_ros.recording.bag.messages import SAMPLE_SPREAD as SAMPLE_SPREAD
    from soilmoist_ros.recording.bag.messages import STAMP_OFFSET as STAMP_OFFSET
    from soilmoist_ros.recording.bag.messages import count_points as count_points
    from soilmoist_ros.recording.bag.messages import count_records as count_records
    from soilmoist_ros.recording.bag.messages import line_bytes as line_bytes
    from soilmoist_ros.recording.bag.messages import line_text as line_text
    from soilmoist_ros.recording.bag.messages import points as points
    from soilmoist_ros.recording.bag.messages import quarantined_topic as quarantined_topic
    from soilmoist_ros.recording.bag.messages import sample_points as sample_points
    from soilmoist_ros.recording.bag.messages import stamp_parts as stamp_parts
    from soilmoist_ros.recording.bag.messages import visit_of as visit_of
    from soilmoist_ros.recording.bag.messages import visit_values as visit_values
    from soilmoist_ros.recording.bag.metadata import Qos as Qos
    from soilmoist_ros.recording.bag.metadata import Request as Request
    from soilmoist_ros.recording.bag.metadata import Topic as Topic
    from soilmoist_ros.recording.bag.metadata import find_definition as find_definition
    from soilmoist_ros.recording.bag.metadata import request_for as request_for
    from soilmoist_ros.recording.bag.plain_topics import CLOUD as CLOUD
    from soilmoist_ros.recording.bag.plain_topics import PlainTopics as PlainTopics
    from soilmoist_ros.recording.bag.playback import INPUTS as INPUTS
    from soilmoist_ros.recording.bag.playback import Pacer as Pacer
    from soilmoist_ros.recording.bag.playback import Playback as Playback
    from soilmoist_ros.recording.bag.playback import TopicChoice as TopicChoice
    from soilmoist_ros.recording.bag.reader import VISIT as VISIT
    from soilmoist_ros.recording.bag.reader import BagReader as BagReader
    from soilmoist_ros.recording.bag.reader import bags_of as bags_of
    from soilmoist_ros.recording.bag.recorder import BagRecorder as BagRecorder
    from soilmoist_ros.recording.bag.recorder import Excess as Excess
    from soilmoist_ros.recording.bag.recorder import SequenceGaps as SequenceGaps
    from soilmoist_ros.recording.bag.recorder import check_name as check_name
    from soilmoist_ros.recording.bag.recorder import delete_bags as delete_bags
    from soilmoist_ros.recording.bag.recorder import excess_text as excess_text
    from soilmoist_ros.recording.bag.recorder import find_excess as find_excess
    from soilmoist_ros.recording.bag.recorder import free_bytes as free_bytes
    from soilmoist_ros.recording.bag.recorder import next_bag as next_bag
    from soilmoist_ros.recording.bag.recorder import recorder_health as recorder_health
    from soilmoist_ros.recording.bag.storage import recorder_notes as recorder_notes
    from soilmoist_ros.recording.bag.verify import bag_info as bag_info
    from soilmoist_ros.recording.bag.verify import recover_bag as recover_bag
    from soilmoist_ros.recording.bag.writer import BagWriter as BagWriter
    from soilmoist_ros.recording.journal import Journal as Journal
    from soilmoist_ros.recording.journal import load_journal as load_journal
    from soilmoist_ros.recording.map_records import HELD as HELD
    from soilmoist_ros.recording.map_records import LIST_S as LIST_S
    from soilmoist_ros.recording.map_records import MAX_RECORDS as MAX_RECORDS
    from soilmoist_ros.recording.map_records import MISSED as MISSED
    from soilmoist_ros.recording.map_records import RECEIVED as RECEIVED
    from soilmoist_ros.recording.map_records import START as START
    from soilmoist_ros.recording.map_records import TEAM as TEAM
    from soilmoist_ros.recording.map_records import TEAM_S as TEAM_S
    from soilmoist_ros.recording.map_records import MapRecords as MapRecords
    from soilmoist_ros.recording.map_records import RecordExchange as RecordExchange
    from soilmoist_ros.recording.map_records import record_key as record_key
    from soilmoist_ros.recording.map_sources import DRIVER as DRIVER
    from soilmoist_ros.recording.map_sources import MapSources as MapSources
    from soilmoist_ros.recording.map_sources import RecordLog as RecordLog
    from soilmoist_ros.recording.run_folder import CONFIGURATION as CONFIGURATION
    from soilmoist_ros.recording.run_folder import SUMMARY as SUMMARY
    from soilmoist_ros.recording.run_folder import RunConfiguration as RunConfiguration
    from soilmoist_ros.recording.run_folder import bag_of as bag_of
    from soilmoist_ros.recording.run_folder import configuration_of as configuration_of
    from soilmoist_ros.recording.run_folder import copy_configuration as copy_configuration
    from soilmoist_ros.recording.run_folder import is_bag as is_bag
    from soilmoist_ros.recording.run_folder import message_files as message_files
    from soilmoist_ros.recording.run_folder import read_parameters as read_parameters
    from soilmoist_ros.recording.run_folder import sync_file as sync_file
    from soilmoist_ros.recording.run_folder import sync_folder as sync_folder
    from soilmoist_ros.recording.run_folder import write_parameters as write_parameters
    from soilmoist_ros.recording.run_folder import write_whole as write_whole
    from soilmoist_ros.recording.stored_mission import StoredMission as StoredMission
    from soilmoist_ros.recording.stored_records import COLUMNS as COLUMNS
    from soilmoist_ros.recording.stored_records import RECORDS as RECORDS
    from soilmoist_ros.recording.stored_records import quarantine_reasons as quarantine_reasons
    from soilmoist_ros.recording.stored_records import read_earlier as read_earlier
    from soilmoist_ros.recording.stored_records import read_records as read_records
    from soilmoist_ros.recording.stored_records import write_records as write_records

__getattr__, __dir__, __all__ = open_door(
    __name__,
    {
        "bag.info": "info_table plain_text print_plain recovery_table verified_table",
        "bag.messages": "COUNT_DATUM COUNT_POINT DATATYPES FRAME QUARANTINED REASON REASONS SAMPLE_POINT SAMPLE_SPREAD STAMP_OFFSET count_points count_records line_bytes line_text points quarantined_topic sample_points stamp_parts visit_of visit_values",
        "bag.metadata": "Qos Request Topic find_definition request_for",
        "bag.plain_topics": "CLOUD PlainTopics",
        "bag.playback": "INPUTS Pacer Playback TopicChoice",
        "bag.reader": "BagReader VISIT bags_of",
        "bag.recorder": "BagRecorder Excess SequenceGaps check_name delete_bags excess_text find_excess free_bytes next_bag recorder_health",
        "bag.storage": "recorder_notes",
        "bag.verify": "bag_info recover_bag",
        "bag.writer": "BagWriter",
        "journal": "Journal load_journal",
        "map_records": "HELD LIST_S MAX_RECORDS MISSED MapRecords RECEIVED RecordExchange START TEAM TEAM_S record_key",
        "map_sources": "DRIVER MapSources RecordLog",
        "run_folder": "CONFIGURATION RunConfiguration SUMMARY bag_of configuration_of copy_configuration is_bag message_files read_parameters sync_file sync_folder write_parameters write_whole",
        "stored_mission": "StoredMission",
        "stored_records": "COLUMNS RECORDS quarantine_reasons read_earlier read_records write_records",
    },
)
