# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Record messages in a separate thread, so that a slow disk never blocks the node."""

from __future__ import annotations

import errno
import logging
import math
import re
import shutil
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from soilmoist_ros.foundation import Health, InputError, Level
from soilmoist_ros.recording.bag.metadata import TimedMessage, Topic
from soilmoist_ros.recording.bag.writer import BagGoneError, BagWriter, is_being_written

_LOG = logging.getLogger(__name__)
_RETRY_S: Final = 2.0
_SIZES, _SIZE_S = 60, 10.0  # sizes of the bag from which its growth is computed, and time between two of them [s]
_NO_SPACE: Final = (errno.ENOSPC, errno.EDQUOT)
_RECOVER: Final = "to restore what it has: soilmoist bag recover"


@dataclass(frozen=True)
class RecorderState:
    """State of a recorder."""

    recording: bool = False
    bag: Path | None = None  # folder of the bag, None until it is made
    messages: int = 0
    dropped: int = 0  # messages lost because the disk was too slow, full or gone
    waiting_bytes: int = 0
    size_bytes: int = 0
    rate_bps: float = 0.0  # bytes written in a second, over the last minutes [B/s]; 0 if unknown
    gone: str = ""  # bags that were deleted or moved while they were recorded, in words
    topics: int = 0  # number of topics with messages in the bag
    problem: str = ""  # what prevents writing now; empty without a problem


class BagRecorder:
    """Accepts messages at any time from any thread, and writes them to one bag after the other.

    While the disk is full, read-only or gone, messages wait up to the capacity, and writing is retried. After a
    full disk the same bag is continued; after another error, and if the bag was deleted or moved, a new bag is
    started.

    :param new_bag: makes the next bag; called in the writer's thread
    :param flush_period_s: time between flushes to the disk [s]; a crash loses at most the messages of this time
    :param capacity_bytes: size of messages that may wait [bytes]
    :param retry_s: time between two attempts after an error [s]
    """

    def __init__(
        self,
        new_bag: Callable[[], BagWriter],
        flush_period_s: float = 0.5,
        capacity_bytes: int = 64 << 20,
        retry_s: float = _RETRY_S,
    ) -> None:
        self._new_bag = new_bag
        self._flush_period_s = flush_period_s
        self._capacity_bytes = capacity_bytes
        self._retry_s = retry_s
        self._sizes: deque[tuple[float, int]] = deque(maxlen=_SIZES)
        self._in_bag = 0
        self._queue: deque[TimedMessage] = deque()
        self._changed = threading.Condition()
        self._state = RecorderState()
        self._thread: threading.Thread | None = None
        self._stopping = False
        self._unsafe = 0

    @property
    def state(self) -> RecorderState:
        """The state now."""
        with self._changed:
            return self._state

    def start(self) -> None:
        """Start to record; while it waits to try again, it tries at once; does nothing while it records."""
        with self._changed:
            if self._state.recording:
                if self._state.bag is None and self._state.problem:  # which may be over
                    self._report(problem="")
                return
            self._state = RecorderState(recording=True)
            self._stopping = False
            self._sizes.clear()
            self._thread = threading.Thread(target=self._run, name="bag writer", daemon=True)
            self._thread.start()

    def put(self, topic: Topic, log_ns: int, publish_ns: int, data: bytes) -> bool:
        """Add a message in CDR with the times of its receipt and publication [ns since 1970-01-01 UTC].

        :returns: whether it was accepted: not while stopped, nor when the capacity is exceeded
        """
        if log_ns <= 0:
            log_ns = time.time_ns()
        if publish_ns <= 0:
            publish_ns = log_ns  # some middlewares do not provide it
        with self._changed:
            if self._stopping or not self._state.recording:
                return False
            waiting = self._state.waiting_bytes + len(data)
            if waiting > self._capacity_bytes:
                self._state = replace(self._state, dropped=self._state.dropped + 1)
                return False
            self._queue.append(TimedMessage(topic, log_ns, publish_ns, data))
            self._state = replace(self._state, waiting_bytes=waiting)
            return True

    def wait_open(self, timeout_s: float) -> bool:
        """Wait until there is a bag; returns whether there is one. Otherwise :attr:`state` has the problem."""
        with self._changed:
            self._changed.wait_for(lambda: self._state.bag is not None or bool(self._state.problem), timeout_s)
            return self._state.bag is not None

    def stop(self) -> RecorderState:
        """Write what waits, close the bag and stop; returns the final state. Does nothing while stopped."""
        with self._changed:
            thread = self._thread
            self._stopping = True
            self._changed.notify_all()
        if thread is not None:
            thread.join()
        return self.state

    def _run(self) -> None:
        bag: BagWriter | None = None
        while not self._stopping:
            started = time.monotonic()
            bag = self._turn(bag)
            with self._changed:
                if self._state.problem:
                    self._changed.wait_for(
                        lambda: self._stopping or not self._state.problem,
                        started + self._retry_s - time.monotonic(),
                    )
                else:
                    pause_s = started + self._flush_period_s - time.monotonic()
                    self._changed.wait_for(lambda: self._stopping, max(0.0, pause_s))
        bag = self._turn(bag)
        problem, unsafe = self.state.problem, 0
        with self._changed:
            waiting = len(self._queue)
            self._queue.clear()
        if bag is not None:
            try:
                if problem:  # the disk is full; after another problem there is no bag
                    bag.abandon()
                    unsafe, self._unsafe = self._unsafe, 0
                    problem = f"the disk of {bag.folder} is full: {unsafe + waiting} messages are lost; {_RECOVER}"
                else:
                    state = self.state
                    lost = f"{state.dropped}{f' ({state.gone})' if state.gone else ''}"
                    bag.close({"messages lost in writing": lost} if state.dropped else {})
            except OSError as error:
                problem = f"{bag.folder} could not be closed: {error.strerror}; {_RECOVER}"
        with self._changed:
            messages, dropped = self._state.messages - unsafe, self._state.dropped + unsafe + waiting
            self._report(recording=False, problem=problem, waiting_bytes=0, messages=messages, dropped=dropped)
            self._thread = None

    def _turn(self, bag: BagWriter | None) -> BagWriter | None:
        """Write what waits, and return the bag for the next turn."""
        try:
            if bag is None:
                bag = self._new_bag()
                self._in_bag = 0
                self._sizes.clear()
                self._report(bag=bag.folder, problem="")
                _LOG.info("recording to %s", bag.folder)
            if self.state.problem:
                bag.flush()  # first what the disk refused
                self._unsafe = 0
            self._write_waiting(bag)
            bag.flush()
            self._unsafe = 0
        except InputError as error:
            self._report(problem=str(error))
            return None
        except OSError as error:
            return self._after_error(bag, error)
        rate_bps = self._rate_bps(bag.size_bytes)
        self._report(problem="", size_bytes=bag.size_bytes, topics=len(bag.counts), rate_bps=rate_bps)
        return bag

    def _rate_bps(self, size: int) -> float:
        now_s = time.monotonic()
        if not self._sizes or now_s - self._sizes[-1][0] >= _SIZE_S:
            self._sizes.append((now_s, size))
        first_s, first = self._sizes[0]
        return (size - first) / (now_s - first_s) if now_s - first_s >= _SIZE_S else 0.0

    def _write_waiting(self, bag: BagWriter) -> None:
        due = time.monotonic() + self._flush_period_s
        while True:
            with self._changed:
                batch = list(self._queue)
                self._queue.clear()
            for index, message in enumerate(batch):
                self._unsafe += 1
                try:
                    bag.write(*message)
                except OSError:
                    self._written(batch[: index + 1])
                    with self._changed:
                        self._queue.extendleft(reversed(batch[index + 1 :]))
                    raise
            self._written(batch)
            if not batch or time.monotonic() >= due:
                return

    def _written(self, messages: list[TimedMessage]) -> None:
        self._in_bag += len(messages)
        with self._changed:
            self._state = replace(
                self._state,
                messages=self._state.messages + len(messages),
                waiting_bytes=self._state.waiting_bytes - sum(len(message.data) for message in messages),
            )

    def _after_error(self, bag: BagWriter | None, error: OSError) -> BagWriter | None:
        if bag is not None and error.errno in _NO_SPACE:
            self._report(problem=f"the disk of {bag.folder} is full: make space; nothing is lost so far")
            return bag
        problem = f"cannot write: {error.strerror or error}"
        gone, lost = self.state.gone, self._unsafe
        if bag is not None:
            bag.abandon()
            problem = f"{bag.folder} can no longer be written: {error.strerror}; {_RECOVER}"
            if isinstance(error, BagGoneError):
                lost = self._in_bag
                problem = gone = f"{bag.folder} was deleted or moved while it was recorded, with {lost} messages"
        with self._changed:
            self._state = replace(
                self._state,
                bag=None,
                problem=problem,
                gone=gone,
                messages=self._state.messages - lost,
                dropped=self._state.dropped + lost,
            )
        self._unsafe = 0
        _LOG.error("%s", problem)
        return None

    def _report(self, **changes: object) -> None:
        with self._changed:
            problem = changes.get("problem", "")
            if problem and problem != self._state.problem:
                _LOG.error("%s", problem)
            self._state = replace(self._state, **changes)  # type: ignore[arg-type]
            self._changed.notify_all()


def check_name(name: str) -> None:
    """Check that the name of a bag is a plain name of a folder; ``InputError`` if it is not."""
    if not re.fullmatch(r"[\w.-]*", name) or name.strip(".") != name:
        raise InputError(f"{name!r} is not a valid name of a bag", "use letters, digits, '_' and '-'")


def next_bag(out: Path, name: str, distribution: str) -> BagWriter:
    """The next bag of a recorder in a folder. The name gets a number if it exists.

    :param name: name of the bag; the time of day if empty
    :raises InputError: if another recorder is writing a bag of the name, or none can be made
    :raises OSError: if the folder cannot be read
    """
    base = name or time.strftime("run_%Y-%m-%d_%H-%M-%S", time.gmtime())
    folder, number = out / base, 1
    while folder.exists() and not is_being_written(folder / f"{folder.name}_0.mcap"):
        number += 1
        folder = out / f"{base}_{number}"
    return BagWriter(folder, distribution)


def free_bytes(folder: Path) -> int | None:
    """Space left on the disk of a folder, or of its nearest parent that exists [bytes]; ``None`` if unknown."""
    for place in (folder.absolute(), *folder.absolute().parents):
        try:
            return shutil.disk_usage(place).free
        except FileNotFoundError:
            continue
        except OSError:
            return None
    return None


def recorder_health(
    state: RecorderState, free_bytes: int | None, low_disk_bytes: float, skipped: int = 0, full_soon_s: float = 0.0
) -> Health:
    """Health of the recorder.

    :param free_bytes: space left on its disk [bytes], ``None`` if unknown
    :param low_disk_bytes: free space below which the recorder warns [bytes]
    :param skipped: topics that are not recorded because their type is not installed
    :param full_soon_s: time to a full disk below which the recorder warns [s]
    """
    full_s = free_bytes / state.rate_bps if free_bytes is not None and state.rate_bps > 0 else math.inf
    low = free_bytes is not None and free_bytes < low_disk_bytes
    warnings = (
        (not state.recording, "not recording"),
        (low, f"only {(free_bytes or 0) / 1e6:.0f} MB left on the disk"),
        (full_s < full_soon_s, f"the disk will be full in {full_s / 60:.0f} min"),
        (state.dropped > 0, f"{state.dropped} messages lost: the disk is too slow"),
    )
    warning = next((message for is_so, message in warnings if is_so), "")
    level = Level.ERROR if state.problem or state.gone else Level.WARN if warning else Level.OK
    message = state.problem or state.gone or warning or "recording"
    values = {
        "bag": str(state.bag or ""),
        "messages": str(state.messages),
        "dropped": str(state.dropped),
        "topics": str(state.topics),
        "topics skipped": str(skipped),
        "size [MB]": f"{state.size_bytes / 1e6:.3f}",
        "waiting [MB]": f"{state.waiting_bytes / 1e6:.3f}",
        "written [kB/s]": f"{state.rate_bps / 1e3:.3g}",
        "disk full in [h]": f"{full_s / 3600:.1f}" if math.isfinite(full_s) else "unknown",
        "disk free [MB]": "unknown" if free_bytes is None else f"{free_bytes / 1e6:.0f}",
    }
    return Health("bag", level, message, values)
