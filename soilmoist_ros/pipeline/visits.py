# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The visits of a recorded mission: from the topic ``visits``, or estimated from statuses in older bags."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate

from soilmoist_ros.exploration import Visit
from soilmoist_ros.pipeline.statuses import Status
from soilmoist_ros.pipeline.topics import RunTopics
from soilmoist_ros.recording import VISIT
from soilmoist_ros.sensing import CountRecord

_CLOCK_S = 1e-3
_WITHOUT_TIME = {"idle", "finished"}


def read_visits(topics: RunTopics, robot: int = 1) -> list[Visit] | None:
    """The visits that a robot's planner published; ``None`` if the bag lacks the topic.

    :param topics: topics of the robot
    :param robot: number of the robot, from 1
    :raises InputError: if the topic contains other messages
    """
    name = topics.find("visits", VISIT)
    return None if name is None else topics.reader.read_visits(name, robot)


def mission_visits(
    statuses: Sequence[Status], visits: Sequence[Visit] | None, records: Sequence[CountRecord]
) -> list[Visit]:
    """The visits of one mission, in order.

    :param statuses: statuses of the started mission, in order
    :param visits: visits of all missions in the bag, ``None`` if the bag lacks them
    :param records: all records of the robot
    """
    if visits is None:
        return estimate_visits(statuses, records)
    # Where the clock was set, the mission has a start on each clock. Its time stands still before and after it.
    began_s = {round(one.stamp_s - one.time_used_s, 3) for one in statuses if one.state not in _WITHOUT_TIME}
    return [
        visit
        for visit in visits
        if any(abs(visit.arrival_stamp_s - visit.arrived_s - start_s) <= _CLOCK_S for start_s in began_s)
    ]


def estimate_visits(statuses: Sequence[Status], records: Sequence[CountRecord]) -> list[Visit]:
    """Estimate the visits of one mission from its statuses, in order.

    :param statuses: statuses of a started mission, in order
    :param records: all records of the robot
    """
    visits: list[Visit] = []
    stop: list[Status] = []
    chosen_because = ""
    before = statuses[0]
    for status in statuses:
        if status.samples > before.samples and stop:
            visits.append(_visit(stop, status, chosen_because, records))
        if status.state == "travelling":  # it may end a stop too: its reason is about the next stop
            chosen_because = status.reason.partition(": ")[2] or status.reason
        if status.state == "counting":
            stop = [*stop, status] if stop and stop[-1].target == status.target else [status]
        elif status.state != "paused":  # a pause does not end a stop
            stop = []
        before = status
    return visits


def _visit(stop: Sequence[Status], done: Status, reason: str, records: Sequence[CountRecord]) -> Visit:
    first, last = stop[0], stop[-1]
    return Visit(
        last.target,
        last.target_x_m,
        last.target_y_m,
        first.time_used_s - first.elapsed_dwell_s,
        last.elapsed_dwell_s + done.counting_s - last.counting_s,
        _raw_counts(last, done, first.stamp_s - first.elapsed_dwell_s, records),
        reason,
    )


def _raw_counts(last: Status, done: Status, arrived_s: float, records: Sequence[CountRecord]) -> int:
    """Counts of a stop: the counts of its last status plus the counts of later records.

    The last record ends a stop at once, so no status at the stop includes its counts. A record with an earlier
    stamp than the last status may arrive later. Counts, not stamps, therefore decide which records the status
    includes. After a pause the stop has more records than the mission counted, and stamps decide.
    """
    there = [
        record
        for record in records
        if record.stamp_s <= done.stamp_s and record.stamp_s - record.exposure_s >= arrived_s - _CLOCK_S
    ]
    sums = list(accumulate((record.raw_counts for record in there), initial=0))
    if last.raw_counts in sums:
        later = there[sums.index(last.raw_counts) :]
    else:
        later = [record for record in there if record.stamp_s > last.stamp_s]
    return last.raw_counts + sum(record.raw_counts for record in later)
