# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Memory that was freed goes back to the system: memory.py."""

import ctypes
import subprocess
import sys

import pytest

WORK = """
import re, threading
import numpy as np
from soilmoist_ros.nodes.run import return_memory

def resident_mb():
    return int(re.search(r"VmRSS:\\s+(\\d+)", open("/proc/self/status").read())[1]) / 1024

def work():
    np.ones(3_500_000)
    arrays = [np.ones(500_000) for _ in range(8)]

if {returned}:
    assert return_memory()
before_mb = resident_mb()
thread = threading.Thread(target=work)
thread.start()
thread.join()
print(resident_mb() - before_mb)
"""


def growth_mb(returned: bool) -> float:
    """How much a process grows by arrays that a thread has used and freed [MB]."""
    command = [sys.executable, "-c", WORK.format(returned=returned)]
    return float(subprocess.run(command, capture_output=True, check=True, timeout=60).stdout)


@pytest.mark.process
@pytest.mark.skipif(not hasattr(ctypes.CDLL(None), "gnu_get_libc_version"), reason="not the GNU C library")
def test_what_a_thread_frees_goes_back():
    assert growth_mb(True) < 10 < growth_mb(False)
