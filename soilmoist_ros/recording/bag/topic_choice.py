# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Which topics to record."""

from __future__ import annotations

import re

from soilmoist_ros.foundation import InputError

_ACTION_STATUS = "/_action/status"


class TopicChoice:
    """Topics chosen by regular expressions.

    Hidden topics, with a part of the name that begins with ``_``, are excluded. The states of actions are
    included, since they show the outcome of the goals.

    >>> TopicChoice(exclude="/camera/.*").wanted("/camera/image")
    False

    :param include: expression that must match the full name
    :param exclude: expression that must not match it; excludes nothing if empty
    :raises InputError: if one is not a regular expression
    """

    def __init__(self, include: str = ".*", exclude: str = "") -> None:
        self._include = _compiled("include", include)
        self._exclude = _compiled("exclude", exclude) if exclude else None

    def wanted(self, name: str) -> bool:
        """Whether to record a topic.

        :param name: its full name
        """
        if "/_" in name and not name.endswith(_ACTION_STATUS):
            return False
        if self._exclude is not None and self._exclude.fullmatch(name):
            return False
        return self._include.fullmatch(name) is not None


def _compiled(what: str, pattern: str) -> re.Pattern[str]:
    try:
        return re.compile(pattern)
    except re.error as error:
        raise InputError(
            f"{what}: {pattern!r} is not a regular expression: {error}", "an example is '/robot1/.*|/diagnostics'"
        ) from None
