# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Shared work: in this process, in local processes, or on a cluster."""

import os
import sys

import pytest

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.foundation.workers import connect, cores, one_thread_each, shared_work


def test_without_processes_the_work_is_done_here():
    with shared_work(0) as compute:
        assert list(compute(abs, [-1, 2, -3])) == [1, 2, 3]
    assert cores() >= 1


def test_one_thread_each_is_undone(monkeypatch):
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "4")
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    with one_thread_each():
        assert (os.environ["OPENBLAS_NUM_THREADS"], os.environ["OMP_NUM_THREADS"]) == ("1", "1")
    assert os.environ["OPENBLAS_NUM_THREADS"] == "4"
    assert "OMP_NUM_THREADS" not in os.environ


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
        ("nonsense://x:8786", "not the address"),
        ("tcp://host", "not the address"),
        ("tcp://host:99999", "not the address"),
        ("tls://127.0.0.1:9", "needs keys"),
    ],
)
def test_an_address_that_is_none_is_refused_before_dask_sees_it(address, message, monkeypatch):
    distributed = pytest.importorskip("distributed")
    monkeypatch.setattr(distributed, "Client", lambda *_, **__: pytest.fail("a client was made"))
    with pytest.raises(InputError, match=message):
        connect(address)
