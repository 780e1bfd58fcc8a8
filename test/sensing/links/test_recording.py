# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Recorded lines are played in step."""

from scripted_server import opened, read

from soilmoist_ros.sensing.lines import LinkState, PlaybackClock, RecordingSource


def test_a_file_as_fast_as_possible_and_then_it_has_ended(tmp_path):
    path = tmp_path / "a log.txt"
    path.write_bytes(b"one\r\ntwo\nthree")
    with opened(f"{path.as_uri()}?speed=0") as source:
        assert read(source, 3) == [b"one", b"two", b"three"]
        assert source.status.state is LinkState.ENDED
        assert source.read_line(0.0) is None


def test_recordings_that_share_a_clock_stay_in_step_at_any_speed(tmp_path):
    now = [100.0]
    playback = PlaybackClock(lambda: now[0])
    sources = {}
    for name, text in (("a", b"0\nheader\n4\n6\n"), ("b", b"2\n5\n")):
        (tmp_path / name).write_bytes(text)
        stamp_of = lambda line: float(line) if line.isdigit() else None  # noqa: E731
        sources[name] = RecordingSource(tmp_path / name, 2.0, stamp_of, playback)
    played = []
    while len(played) < 6:
        for name in ("a", "b", "a", "b"):
            while (line := sources[name].read_line(0.0)) is not None:
                played.append((now[0] - 100.0, name, line))
        now[0] += 0.5
    assert played == [
        (0.0, "a", b"0"), (0.0, "a", b"header"), (1.0, "b", b"2"),
        (2.0, "a", b"4"), (2.5, "b", b"5"), (3.0, "a", b"6"),
    ]  # fmt: skip
