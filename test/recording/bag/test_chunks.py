# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Bags of strangers: a small file must not fill the memory, nor take long: chunks.py, scan.py."""

import subprocess
import sys
import textwrap

import pytest
from bombs import bombs

NAMES = (
    "chunks in chunks", "claims more than it has", "deep definition", "long attachment", "long index",
    "long metadata", "long record", "long statistics", "long strings", "lz4, claims a gigabyte", "lz4, honest",
    "many chunks", "many chunks at once", "many chunks of zeros", "many heads of chunks", "many qualities",
    "many records of nothing", "many schemas", "plain, claims a gigabyte", "qualities that laugh",
    "summary ends before it begins", "summary is the file", "zstd, claims little", "zstd, claims the largest",
    "zstd, honest",
)  # fmt: skip
LIMIT = """
    import resource, sys, time
    from pathlib import Path
    import numpy, rosbags.typesys
    from soilmoist_ros.foundation.errors import InputError
    from soilmoist_ros.recording.bag.info import bag_info
    from soilmoist_ros.recording.bag.reader import BagReader
    from soilmoist_ros.recording.bag.verify import recover_bag
    from soilmoist_ros.recording.bag.storage import open_storages

    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    limit = used + (400 << 20)
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    resource.setrlimit(resource.RLIMIT_CPU, (60, 60))

    def read(path):
        with BagReader(path) as reader:
            for message in reader.messages():
                if message.topic == "/notes" and message.log_ns == 1:
                    reader.decode(message)
                    break
            return sum(1 for _ in reader.messages())

    path = Path(sys.argv[1])
    for work in (bag_info, read, lambda path: recover_bag(path, path.parent / "recovered")):
        try:
            found = work(path)
            print(getattr(found, "problems", found))
        except InputError as error:
            print("refused:", error)
"""


@pytest.mark.slow
def test_every_bomb_is_tried():
    assert tuple(sorted(bombs())) == NAMES


@pytest.mark.process
@pytest.mark.parametrize("name", NAMES)
def test_a_small_file_takes_little_memory_and_time(tmp_path, name):
    path = tmp_path / "bomb.mcap"
    path.write_bytes(bombs()[name])
    assert path.stat().st_size < 120_000
    code = textwrap.dedent(LIMIT)
    done = subprocess.run([sys.executable, "-c", code, str(path)], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr[-2000:]
    assert "Traceback" not in done.stderr
    assert "Out of memory" not in done.stdout
