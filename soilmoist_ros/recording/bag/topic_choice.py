"""Which topics to record."""

from __future__ import annotations

import re

from soilmoist_ros.foundation.errors import InputError

_ACTION_STATUS = "/_action/status"


class TopicChoice:
    """Topics chosen by patterns.

    Hidden topics (a part of the name begins with ``_``) are left out, but for the states of actions: they tell
    what became of the goals.

    :param include: pattern that must match the full name
    :param exclude: pattern that must not match it; excludes nothing if empty
    :raises InputError: if one is no regular expression
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
            f"{what}: {pattern!r} is no regular expression: {error}", "an example is '/robot1/.*|/diagnostics'"
        ) from None
