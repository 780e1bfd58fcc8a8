# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Templates, and the frame of every page: one self-contained HTML file with header, style and footer."""

from __future__ import annotations

from functools import cache
from importlib import resources
from typing import TYPE_CHECKING, Any

from soilmoist_ros.reporting.page import numbers

if TYPE_CHECKING:
    from jinja2 import Environment

FILTERS = ("number", "percent", "plain", "tidy", "with_sd")


def render_page(
    template: str, *, title: str, version: str, place: str = "", when: str = "", where: str = "",
    simulated: bool = False, **content: Any,
) -> str:  # fmt: skip
    """Render a template that extends ``frame.html.j2``; blocks ``content`` and ``footer`` are its own.

    :param template: name of a file in ``templates``
    :param title: title of the page and its heading
    :param version: version of this package
    :param place: field, for the title of the window
    :param when: date and duration, below the heading
    :param where: field, site and time of creation, below the date
    :param simulated: whether the page says that no real field was measured
    :param content: further variables of the template
    """
    frame = {"title": title, "version": version, "place": place, "when": when, "where": where}
    return fill_template(template, **frame, simulated=simulated, **content)


def fill_template(name: str, **content: Any) -> str:
    """A file of ``templates`` filled with content, which is escaped for HTML and XML."""
    return _environment().get_template(name).render(**content)


@cache
def _environment() -> Environment:
    from jinja2 import Environment, FunctionLoader, StrictUndefined
    from markupsafe import Markup

    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True,
        loader=FunctionLoader(_text),
    )  # fmt: skip
    for name in FILTERS:
        environment.filters[name] = getattr(numbers, name)
    environment.globals["asset"] = lambda name: Markup(_text(name))
    return environment


def _text(name: str) -> str:
    """A file of the package's templates."""
    return resources.files("soilmoist_ros.reporting.page").joinpath("templates", name).read_text(encoding="utf-8")
