# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Files of strangers: whatever they hold, they are read or refused with a reason."""

import random
import subprocess
import sys
import textwrap
from contextlib import suppress
from pathlib import Path

import pytest
from bombs import bombs

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.recording.bag.reader import BagReader
from soilmoist_ros.recording.bag.verify import bag_info

GOLDEN = Path(__file__).resolve().parents[2] / "golden" / "one_stop" / "bag"
NUMBERS = [0, 1, 64 << 20, 2**31, 2**32 - 1, 2**63, 2**64 - 1]


def changed(data, rng):
    """Data with bits flipped, bytes set, pieces removed or repeated, numbers replaced, or the end cut off."""
    data = bytearray(data)
    for _ in range(rng.choice([1, 1, 2, 4, 16])):
        place = rng.randrange(len(data) or 1)
        change = rng.randrange(6)
        if change == 0 and data:
            data[place] ^= 1 << rng.randrange(8)
        elif change == 1:
            data[place : place + 1] = rng.randbytes(1)
        elif change == 2:
            del data[place : place + rng.randrange(1, 64)]
        elif change == 3:
            data[place:place] = data[rng.randrange(len(data) or 1) :][: rng.randrange(1, 200)]
        elif change == 4:
            data[place : place + 8] = rng.choice(NUMBERS).to_bytes(8, "little")
        else:
            del data[place:]
    return bytes(data)


def read(path):
    with BagReader(path) as reader:
        for message in reader.messages():
            reader.decode(message)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_a_file_is_read_or_refused(tmp_path, seed):
    rng = random.Random(seed)
    files = [data for data in bombs().values() if len(data) < 5000] + [(GOLDEN / "bag_0.mcap").read_bytes()]
    metadata = (GOLDEN / "metadata.yaml").read_bytes()
    for _ in range(8):
        (tmp_path / "bag_0.mcap").write_bytes(changed(rng.choice(files), rng))
        (tmp_path / "metadata.yaml").write_bytes(rng.choice([metadata, changed(metadata, rng)]))
        for work in (bag_info, read):
            for path in (tmp_path, tmp_path / "bag_0.mcap"):
                with suppress(InputError):
                    work(path)


LIMIT = """
    import resource, sys
    from pathlib import Path
    import numpy, rosbags.typesys
    from soilmoist_ros.foundation.errors import InputError
    from soilmoist_ros.recording.bag.reader import BagReader
    from soilmoist_ros.recording.bag.verify import bag_info, recover_bag

    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + (400 << 20),) * 2)
    resource.setrlimit(resource.RLIMIT_CPU, (60, 60))

    def read(path):
        with BagReader(path) as reader:
            for message in reader.messages():
                if message.topic == "/notes":
                    reader.decode(message)

    for path in map(Path, sys.argv[1:]):
        for work in (bag_info, read, lambda path: recover_bag(path, path.parent / f"recovered_{path.stem}")):
            try:
                work(path)
            except InputError:
                pass
"""


@pytest.mark.process
def test_small_files_that_claim_or_unpack_to_much_take_little_memory_and_time(tmp_path):
    paths = [tmp_path / f"{number}.mcap" for number in range(len(bombs()))]
    for path, data in zip(paths, bombs().values(), strict=True):
        path.write_bytes(data)
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(LIMIT), *map(str, paths)], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr[-2000:]
