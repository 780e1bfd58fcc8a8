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

from __future__ import annotations

from typing import TYPE_CHECKING

from soilmoist_ros.foundation.lazy import load_on_use

if TYPE_CHECKING:
    from soilmoist_ros.recording.bag.info import BagInfo, bag_info
    from soilmoist_ros.recording.bag.reader import BagReader
    from soilmoist_ros.recording.bag.recovery import RecoveredBag, recover_bag
    from soilmoist_ros.recording.bag.writer import BagWriter
    from soilmoist_ros.recording.journal import Journal, load_journal
    from soilmoist_ros.recording.record_table import read_records, write_records
    from soilmoist_ros.recording.run_folder import read_parameters, write_parameters

__all__ = [
    "BagInfo",
    "BagReader",
    "BagWriter",
    "Journal",
    "RecoveredBag",
    "bag_info",
    "load_journal",
    "read_parameters",
    "read_records",
    "recover_bag",
    "write_parameters",
    "write_records",
]

__getattr__ = load_on_use(__name__, __file__)
