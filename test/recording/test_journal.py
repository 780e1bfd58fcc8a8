# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The journal survives every cut, and skips damaged lines."""

import errno
import json
import os
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.recording.journal import Entry, Journal, decode, encode, load_journal

PLAIN = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3), max_leaves=6,
)  # fmt: skip


def written(folder, count=4):
    with Journal.open(folder) as journal:
        for number in range(count):
            journal.append("event", {"place": [number, 0.1 * number], "crc": "J\n*", "name": f"stop {number}"})
    return folder / "journal.jsonl"


@pytest.mark.slow
@given(st.lists(st.tuples(st.text(), st.dictionaries(st.text(), PLAIN, max_size=3)), max_size=5))
def test_entries_come_back_as_they_were(contents):
    entries = tuple(Entry(seq, kind, payload) for seq, (kind, payload) in enumerate(contents, 1))
    data = b"".join(map(encode, entries))
    lines = decode(data)
    assert lines.entries == entries
    assert not lines.problems
    assert lines.good_bytes == len(data)
    assert [json.loads(line)["seq"] for line in data.splitlines()] == [entry.seq for entry in entries]


@pytest.mark.slow
def test_a_cut_at_any_byte_costs_only_the_entry_that_was_being_written(tmp_path):
    path = written(tmp_path / "a")
    whole = path.read_bytes()
    for cut in range(len(whole) + 1):
        path.write_bytes(whole[:cut])
        # An entry that lacks only its newline is complete.
        ends = [match.start() for match in re.finditer(rb"\n", whole)]
        loaded = load_journal(path.parent)
        assert len(loaded.entries) == sum(end <= cut for end in ends)
        at_an_end = cut == 0 or cut in ends or cut - 1 in ends
        assert bool(loaded.problems) == (not at_an_end)
        with Journal.open(path.parent) as journal:
            assert journal.append("event", {}) == len(loaded.entries) + 1
        again = load_journal(path.parent)
        assert not again.problems
        assert again.entries[:-1] == loaded.entries


@pytest.mark.parametrize(
    "damage",
    [
        b"\0" * 1_000_000,
        b'{"seq":1,"kind":"event","data":{' + b"x" * 1_000_000 + b'},"crc":"00000000"}',
        b',"crc":"00000000"}' * 60_000,
        b'{"seq":1,"kind":"event","data":' + b"[" * 1_000_000,
        b"\n" * 100_000,
    ],
)
def test_a_damaged_line_is_skipped_whatever_it_holds(damage):
    first, last = encode(Entry(1, "event", {"n": 1})), encode(Entry(2, "event", {"n": 2}))
    lines = decode(first + damage + b"\n" + last)
    assert [entry.seq for entry in lines.entries] == [1, 2]
    assert 1 <= len(lines.problems) <= 101


def test_replay_gives_the_same_state_from_any_moment(tmp_path):
    # State = sum of everything; wrong if an entry is replayed twice or not at all.
    def replayed():
        snapshot, entries, problems, _ = load_journal(tmp_path)
        assert not problems
        return int(snapshot or 0) + sum(entry.payload["n"] for entry in entries)

    state = 0
    for restart in range(3):
        with Journal.open(tmp_path) as journal:
            for number in range(7):
                state += number + 10 * restart
                journal.append("event", {"n": number + 10 * restart})
                if number % 3 == restart:
                    journal.snapshot(str(state))
                assert replayed() == state


def test_a_ruined_snapshot_costs_nothing(tmp_path):
    with Journal.open(tmp_path) as journal:
        journal.append("event", {"n": 1})
        journal.snapshot("state")
    (tmp_path / "snapshot.json").write_bytes(b"nonsense\n")
    snapshot, entries, problems, _ = load_journal(tmp_path)
    assert snapshot is None
    assert [entry.seq for entry in entries] == [1]
    assert "all entries are replayed" in problems[-1]


def test_numbers_go_on_after_the_snapshot_when_entries_are_lost(tmp_path):
    with Journal.open(tmp_path) as journal:
        for _ in range(3):
            journal.append("event", {})
        journal.snapshot("state")
    (tmp_path / "journal.jsonl").write_bytes(b"")
    with Journal.open(tmp_path) as journal:
        assert journal.append("event", {}) == 4
    loaded = load_journal(tmp_path)
    assert (loaded.snapshot, loaded.problems, loaded.complete) == ("state", (), True), "the snapshot includes them"
    assert [entry.seq for entry in loaded.entries] == [4]
    later = [encode(Entry(seq, "event", {})) for seq in (4, 4, 7)]
    (tmp_path / "journal.jsonl").write_bytes(b"".join(later))
    loaded = load_journal(tmp_path)
    assert [entry.seq for entry in loaded.entries] == [4, 7]
    assert "entry 4 occurs twice" in loaded.problems[0]
    assert "entries 5 to 6 are missing" in loaded.problems[1]
    assert not loaded.complete


def test_two_missions_cannot_write_one_journal(tmp_path):
    with Journal.open(tmp_path), pytest.raises(InputError, match="another mission is writing"):
        Journal.open(tmp_path)
    Journal.open(tmp_path).close()


def test_a_full_disk_leaves_the_journal_whole(tmp_path, monkeypatch):
    with Journal.open(tmp_path) as journal:
        journal.append("event", {"n": 1})
        real = os.write

        calls = []

        def half(descriptor, data):
            calls.append(data)
            if len(calls) > 1:
                raise OSError(errno.ENOSPC, "No space left on device")
            return real(descriptor, data[:20])

        monkeypatch.setattr(os, "write", half)
        with pytest.raises(OSError, match="No space"):
            journal.append("event", {"n": 2})
        monkeypatch.undo()
        assert journal.append("event", {"n": 3}) == 2
    loaded = load_journal(tmp_path)
    assert [entry.payload["n"] for entry in loaded.entries] == [1, 3]
    assert not loaded.problems


def test_no_entry_is_confirmed_that_is_not_on_the_disk(tmp_path, monkeypatch):
    def refuse(_descriptor):
        raise OSError(errno.EIO, "Input/output error")

    with Journal.open(tmp_path) as journal, monkeypatch.context() as patch:
        patch.setattr(os, "fdatasync", refuse)
        with pytest.raises(OSError, match="Input/output"):
            journal.append("event", {})


def test_a_journal_that_is_turned_over_begins_anew(tmp_path):
    with Journal.open(tmp_path) as journal:
        for mission in "abc":
            journal.turn_over(f"before {mission}")
            assert load_journal(tmp_path) == (f"before {mission}", (), (), True)
            for number in range(3):
                journal.append("event", {"mission": mission, "number": number})
    loaded = load_journal(tmp_path)
    assert (loaded.snapshot, loaded.problems) == ("before c", ())
    assert [entry.payload["mission"] for entry in loaded.entries] == ["c"] * 3
    assert [entry.seq for entry in loaded.entries] == [7, 8, 9]
    with Journal.open(tmp_path) as journal:
        assert journal.append("event", {}) == 10
    (tmp_path / "snapshot.json").write_bytes(b"nonsense")
    ruined = load_journal(tmp_path)
    assert [entry.seq for entry in ruined.entries] == [7, 8, 9, 10]
    assert not ruined.complete, "nobody knows the state before"


def test_a_crash_while_a_journal_is_turned_over_loses_and_doubles_nothing(tmp_path, monkeypatch):
    def crash(*_):
        raise KeyboardInterrupt

    with Journal.open(tmp_path) as journal:
        journal.append("event", {"number": 1})
        with monkeypatch.context() as patch:
            patch.setattr("os.ftruncate", crash)
            with pytest.raises(KeyboardInterrupt):
                journal.turn_over("state")
    assert load_journal(tmp_path) == ("state", (), (), True)
