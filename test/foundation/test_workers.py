# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A thread that handles what arrives in batches."""

import threading

from soilmoist_ros.foundation import Batches

LIMIT_S = 30.0


def test_items_that_wait_are_one_batch_in_the_order_of_arrival():
    begun, go_on, batches = threading.Event(), threading.Event(), []

    def handle(batch):
        batches.append(list(batch))
        begun.set()
        go_on.wait(LIMIT_S)

    thread = Batches(handle, "test", max_items=3)
    thread.put(1)
    assert begun.wait(LIMIT_S)
    for item in range(2, 7):
        thread.put(item)
    go_on.set()
    thread.close()
    assert batches == [[1], [2, 3, 4]]
    assert thread.lost == 2
    thread.close()


def test_a_batch_that_fails_does_not_end_the_thread():
    handled = []

    def handle(batch):
        if batch == ["bad"]:
            failed.set()
            raise RuntimeError("bad item")
        handled.extend(batch)
        done.set()

    failed, done = threading.Event(), threading.Event()
    thread = Batches(handle, "test")
    thread.put("bad")
    assert failed.wait(LIMIT_S)
    thread.put("good")
    assert done.wait(LIMIT_S)
    thread.close()
    assert handled == ["good"]


def test_a_flush_waits_until_everything_is_handled():
    begun, go_on, handled = threading.Event(), threading.Event(), []

    def handle(batch):
        begun.set()
        go_on.wait(LIMIT_S)
        handled.extend(batch)

    thread = Batches(handle, "test")
    assert thread.flush(0.0)
    thread.put(1)
    assert begun.wait(LIMIT_S)
    thread.put(2)
    assert not thread.flush(0.01)
    go_on.set()
    assert thread.flush(LIMIT_S)
    assert handled == [1, 2]
    thread.close()
