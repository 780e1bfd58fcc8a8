# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Addresses of sources."""

import pytest

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.sensing.connections import open_source


@pytest.mark.parametrize(
    ("uri", "said"),
    [
        ("", "has no kind"),
        ("192.168.1.20:5000", "write it like tcp://"),
        ("tpc://host:1", "write it like tcp://192.168.1.20:5000"),
        ("tcp://host", "lacks the port"),
        ("tcp://:5000", "lacks the host"),
        ("tcp://host:99999", "ort out of range"),
        ("tcp://host:5000/x", "has a path"),
        ("tcp://host:5000?baud=9600", "unknown option 'baud'; there are: interface"),
        ("udp://0.0.0.0:5000?form=10.0.0.1", "unknown option 'form'; there are: from, interface"),
        ("udp://0.0.0.0:5000?from=", "accepts data from no network"),
        ("udp://0.0.0.0:5000?from=logger.local", "give numeric addresses"),
        ("udp://0.0.0.0:5000?from=10.0.0.1/8", "has host bits set"),
        ("serial://ttyUSB0", "three slashes"),
        ("serial:///dev/ttyUSB0?baud=fast", "baud='fast' is not a number"),
        ("file:///no/such/file", "no such file"),
        ("file://log.txt", "write it like file:///"),
        ("file:///tmp/x?speed=-1", "at least 0"),
    ],
)
def test_a_bad_address_is_refused_with_an_example(uri, said):
    with pytest.raises(InputError) as caught:
        open_source(uri)
    assert said in str(caught.value)
