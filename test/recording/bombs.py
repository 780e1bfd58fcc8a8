# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Small files that claim to be large, or unpack to it; each is made by hand, for no writer makes them."""

import functools
import struct

import lz4.frame
import zstandard

MAGIC = b"\x89MCAP0\r\n"
GIGABYTE = 1 << 30
STRING = b"\0\1\0\0\1\0\0\0\0"


def record(opcode, body, length=None):
    return struct.pack("<BQ", opcode, len(body) if length is None else length) + body


def text(value):
    data = value if isinstance(value, bytes) else value.encode()
    return struct.pack("<I", len(data)) + data


def chunk(packed, size, compression="zstd", start_ns=0, end_ns=2**63, length=None):
    head = struct.pack("<QQQI", start_ns, end_ns, size, 0) + text(compression)
    return record(6, head + struct.pack("<Q", len(packed) if length is None else length) + packed)


def schema(number=1, name="std_msgs/msg/String", definition="string data"):
    return record(3, struct.pack("<H", number) + text(name) + text("ros2msg") + text(definition))


def channel(number=1, topic="/notes", qos=""):
    metadata = text("offered_qos_profiles") + text(qos)
    return record(4, struct.pack("<HH", number, 1) + text(topic) + text("cdr") + text(metadata))


def message(number=1, time_ns=1, data=STRING):
    return record(5, struct.pack("<HIQQ", number, 0, time_ns, time_ns) + data)


def zstd_of(piece, times):
    packer = zstandard.ZstdCompressor().compressobj()
    return b"".join(packer.compress(piece) for _ in range(times)) + packer.flush()


def lz4_of(piece, times):
    packer = lz4.frame.LZ4FrameCompressor()
    parts = [packer.begin(), *(packer.compress(piece) for _ in range(times)), packer.flush()]
    return b"".join(parts)


def file_of(*records, summary=b"", start=None):
    begin = MAGIC + record(1, text("ros2") + text("by hand")) + b"".join(records) + record(15, bytes(4))
    start = (len(begin) if summary else 0) if start is None else start
    return begin + summary + record(2, struct.pack("<QQI", start, 0, 0)) + MAGIC


@functools.cache
def bombs() -> dict[str, bytes]:
    zeros = zstd_of(bytes(1 << 20), 1024)
    begin = schema() + channel()
    good = chunk(begin + message(), len(begin + message()), "")
    laughs = "a0: &a0 [x, x, x]\n" + "".join(
        f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 9)}]\n" for n in range(1, 12)
    )
    deep = "".join(f"T{n} a\n{'=' * 80}\nMSG: p/T{n}\n" for n in range(300))
    return {
        "zstd, honest": file_of(good, chunk(zeros, GIGABYTE)),
        "zstd, claims little": file_of(good, chunk(zeros, 1000)),
        "zstd, claims the largest": file_of(good, chunk(zeros, 2**64 - 1)),
        "lz4, honest": file_of(good, chunk(lz4_of(bytes(1 << 20), 24), 24 << 20, "lz4")),
        "lz4, claims a gigabyte": file_of(good, chunk(lz4_of(bytes(1 << 20), 24), GIGABYTE, "lz4")),
        "claims more than it has": file_of(good, chunk(zstd_of(bytes(1000), 1), GIGABYTE)),
        "plain, claims a gigabyte": file_of(good, chunk(bytes(1000), GIGABYTE, "")),
        "chunks in chunks": file_of(good, chunk(zstd_of(chunk(zeros, GIGABYTE), 1), 50_000)),
        "long record": MAGIC + good + b"".join(record(op, b"", 2**62) for op in range(3, 16)),
        "long strings": file_of(good, record(3, b"\1\0" + b"\xff" * 90), record(4, b"\2\0\1\0" + b"\xff" * 90)),
        "long attachment": file_of(good, record(9, struct.pack("<QQ", 0, 0) + text("a") + b"\xff" * 20)),
        "long index": file_of(good, record(7, b"\1\0" + b"\xff" * 20), record(8, b"\xff" * 90)),
        "long metadata": file_of(good, record(12, b"\xff" * 90)),
        "long statistics": file_of(good, summary=begin + record(11, bytes(42) + b"\xff" * 40)),
        "summary is the file": file_of(good, *[begin] * 500, start=8),
        "summary ends before it begins": file_of(good, start=2**63),
        "qualities that laugh": file_of(schema(), channel(qos=laughs), message()),
        "deep definition": file_of(schema(definition=deep), channel(), message()),
    }
