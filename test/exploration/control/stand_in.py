# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Navigator and outputs of a mission control, in one; tests override what matters to them."""

import math
from concurrent.futures import Executor, Future


class AtOnce(Executor):
    """Plans in the thread that asks."""

    def submit(self, work, /, *args, **kwargs):
        work(*args, **kwargs)
        return Future()


class StandIn:
    waiting_for = on_the_way = caution = other_client = ""
    feedback_age_s = math.nan
    stop_unheard = False
    finished = None
    go = cancel = moved = tick = visit = save = wake = lambda self, *_: None

    def navigator(self, report):
        self.report = report
        return self

    def finish(self, finish):
        self.finished = finish

    def show(self, status, ahead, more):
        self.shown = status
