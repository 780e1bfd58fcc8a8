# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The last header of a logger on the disk: some loggers send it only when they are switched on."""

from __future__ import annotations

import json
import logging
from dataclasses import asdict
from pathlib import Path
from typing import Final

from soilmoist_ros.recording import write_whole
from soilmoist_ros.sensing import Header

NAME: Final = "header.json"

_log = logging.getLogger(__name__)


class StoredHeader:
    """The header of one logger, stored for a driver that starts again.

    :param folder: where the file is
    :param logger_uri: address of the logger; the header of another address is not used
    :param logger_format: its format, likewise
    """

    def __init__(self, folder: Path, logger_uri: str, logger_format: str) -> None:
        self._path = folder / NAME
        self._logger = {"logger_uri": logger_uri, "logger_format": logger_format}
        self.header = self._read()
        """The last header, ``None`` if there is none."""

    def update(self, header: Header) -> None:
        """Store a header, unless it is stored already.

        :raises OSError: if the disk refuses it
        """
        if header != self.header:
            content = {**self._logger, **asdict(header)}
            del content["stored_s"]  # the time of the file
            write_whole(self._path, json.dumps(content, indent=1).encode())
            self.header = header

    def _read(self) -> Header | None:
        if not self._path.exists():
            return None
        try:
            content = json.loads(self._path.read_bytes())
            if any(content[key] != value for key, value in self._logger.items()):
                return None
            names, units = (tuple(map(str, content[key])) for key in ("names", "units"))
            values = {str(key): str(value) for key, value in content["values"].items()}
            return Header(names, units, values, self._path.stat().st_mtime)
        except (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError) as error:
            _log.warning("%s is ignored, it cannot be read: %s", self._path, error)
            return None
