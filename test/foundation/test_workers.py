# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Work on a cluster, and in a thread that takes batches."""

import sys
import threading

import pytest

from soilmoist_ros.foundation import Batches, InputError, connect


@pytest.mark.slow
def test_a_cluster_that_is_not_there(monkeypatch):
    pytest.importorskip("distributed")
    with pytest.raises(InputError, match=r"no Dask scheduler answers at 'tcp://127.0.0.1:9'"):
        connect("tcp://127.0.0.1:9", timeout_s=0.3)
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InputError, match=r"pip install 'soilmoist_ros\[campaign\]'"):
        connect("tcp://127.0.0.1:9")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("address", "message"),
    [
        ("nonsense", "not the address of a Dask scheduler -> give tcp://HOST:PORT"),
        ("tcp://host:99999", "not the address"),
        ("tls://127.0.0.1:9", "needs keys"),
    ],
)
def test_an_address_that_is_none_is_refused_before_dask_sees_it(address, message, monkeypatch):
    distributed = pytest.importorskip("distributed")
    monkeypatch.setattr(distributed, "Client", lambda *_, **__: pytest.fail("a client was made"))
    with pytest.raises(InputError, match=message):
        connect(address)


# A thread that handles what arrives in batches ------------------------------------------------------------------

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
