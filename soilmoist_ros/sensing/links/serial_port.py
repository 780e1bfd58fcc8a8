# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Serial ports."""

from __future__ import annotations

import contextlib
import os
import select

import serial

CHUNK = 4096


class SerialConnection:
    """An open serial port.

    :param port: the port, which does not block
    """

    datagrams = False

    def __init__(self, port: serial.Serial) -> None:
        self._port = port

    def receive(self, timeout_s: float) -> bytes | None:
        """Some bytes, ``None`` after the timeout."""
        descriptor = self._port.fileno()
        ready, _, _ = select.select([descriptor], [], [], min(timeout_s, 0.5))  # close() does not wake it
        if not ready:
            return None
        try:
            data = os.read(descriptor, CHUNK)
        except BlockingIOError:
            return None
        if not data:
            raise ConnectionResetError("the device is gone: check the cable")
        return data

    def close(self) -> None:
        """Close the port."""
        with contextlib.suppress(OSError):
            self._port.close()


def open_serial(device: str, baud: int) -> SerialConnection:
    """Open a port, 8 data bits, no parity, one stop bit.

    :param device: path, such as ``/dev/ttyUSB0``
    :param baud: bits per second
    :raises OSError: if there is no such device, or another program uses it
    """
    return SerialConnection(serial.Serial(device, baud, timeout=0, exclusive=True))
