"""Runs on disk: bags in the rosbag2 layout that survive a crash, the mission's journal, and the folder of a run.

Write a journal, and read it again:

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

import importlib
from typing import TYPE_CHECKING, Any

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

# Loaded when they are first used: the readers and writers of bags take a second to import.
_MODULES = {
    "bag.info": ("BagInfo", "bag_info"),
    "bag.reader": ("BagReader",),
    "bag.recovery": ("RecoveredBag", "recover_bag"),
    "bag.writer": ("BagWriter",),
    "journal": ("Journal", "load_journal"),
    "record_table": ("read_records", "write_records"),
    "run_folder": ("read_parameters", "write_parameters"),
}


def __getattr__(name: str) -> Any:
    for module, names in _MODULES.items():
        if name in names:
            return getattr(importlib.import_module(f"{__name__}.{module}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
