"""One figure of a page with its texts."""

from __future__ import annotations

from dataclasses import dataclass

from soilmoist_ros.reporting.page.style import Picture


@dataclass(frozen=True)
class Section:
    """One figure of the report.

    :param key: anchor in the page
    :param title: heading
    :param picture: the figure
    :param caption: what to see in it
    """

    key: str
    title: str
    picture: Picture
    caption: str
