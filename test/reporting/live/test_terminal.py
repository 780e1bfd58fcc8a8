# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import io
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from rich.console import Console

from soilmoist_ros.reporting.live import terminal
from soilmoist_ros.reporting.live.terminal import LiveBand, LiveView, map_picture, render, scale

RAMP = np.linspace(0.1, 0.4, 8)[None, :] * np.ones((8, 1))


def view(band=RAMP, **changes):
    ny, nx = band.shape
    of = {name: changes.pop(name) for name in ("extent", "wet_is_high") if name in changes}
    shown = LiveBand("moisture", band, **{"extent": (0.0, float(nx), 0.0, float(ny)), **of})
    return LiveView("a mission", {"state": "counting"}, [shown], **changes)


def lines(text):
    return text.plain.split("\n")


def pixels(of, columns=8, rows=4):
    """Colours of a picture's pixels, north first: ``None`` where there is nothing."""
    text = map_picture(of, of.bands[0], columns, rows)
    styles = {}
    for span in text.spans:
        for place in range(span.start, span.end):
            styles[place] = str(span.style).split(" on ")
    picture, place = [], 0
    for line in lines(text):
        upper, lower = [], []
        for character in line:
            colours = styles.get(place, [])
            assert len(colours) == {" ": 0, "▀": len(colours), "▄": 1}[character]
            upper.append(colours[0] if character == "▀" else None)
            lower.append(colours[-1] if character == "▄" or len(colours) == 2 else None)
            place += 1
        picture += [upper, lower]
        place += 1
    return picture


def shown(of, width=80, **options):
    console = Console(file=io.StringIO(), width=width, force_terminal=True, color_system="truecolor")
    console.print(render(of, **options))
    return re.sub(r"\x1b\[[0-9;]*m", "", console.file.getvalue())


def lightness(colour):
    """CIE L* of a colour."""
    linear = [((c / 255 + 0.055) / 1.055) ** 2.4 if c > 10 else c / 255 / 12.92 for c in colour]
    return 116 * np.cbrt(np.dot([0.2126, 0.7152, 0.0722], linear)) - 16


def test_it_is_dark_where_it_is_wet():
    steps = [lightness(colour) for colour in terminal.DRY_TO_WET]
    assert (np.diff(steps) < -5).all()
    for wet_is_high in (True, False):
        row = pixels(view(wet_is_high=wet_is_high))[0]
        light = [lightness([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) for colour in row]
        assert (np.diff(light[1:-1]) * (-1 if wet_is_high else 1) > 0).all()


def test_north_is_up_and_east_is_right():
    band = np.full((4, 6), np.nan)
    band[3, 0] = 1.0
    picture = pixels(view(band), columns=6, rows=2)
    assert [(i, j) for i, line in enumerate(picture) for j, colour in enumerate(line) if colour] == [(0, 0)]


@pytest.mark.parametrize(
    ("place", "pixel"),
    [((0.5, 7.5), (0, 0)), ((7.5, 0.5), (7, 7)), ((-90.0, 3.5), (4, 0)), ((1e308, -1e308), (7, 7)),
     ((8.0, 8.0), (0, 7))],
)  # fmt: skip
def test_marks_stand_at_their_places_or_at_the_edge(place, pixel):
    picture = pixels(view(robots_xy=[place]))
    assert [(i, j) for i, line in enumerate(picture) for j, colour in enumerate(line) if colour == "#e61e3c"] == [
        pixel
    ]


def test_the_robot_is_seen_above_target_and_samples():
    here = (2.5, 2.5)
    samples = np.array([here, (6.5, 6.5), (np.nan, 1.0), (np.inf, 1.0)])
    picture = pixels(view(robots_xy=[(-99.0, 9.0), here], targets_xy=[here], samples_xy=samples))
    assert picture[5][2] == "#e61e3c"
    assert picture[1][6] == "#141414"
    assert sum(colour == "#141414" for line in picture for colour in line) == 1
    assert pixels(view(targets_xy=[here], samples_xy=samples))[5][2] == "#ff8c00"


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(
    band=arrays(
        float,
        st.tuples(st.integers(1, 40), st.integers(1, 40)),
        elements=st.one_of(st.just(np.nan), st.floats(-1e6, 1e6)),
    ),
    columns=st.integers(-3, 50),
    rows=st.integers(-3, 20),
)
def test_any_map_gives_a_picture_within_its_room(band, columns, rows):
    of = view(band)
    console = Console(file=io.StringIO(), width=200)
    console.print(render(of, columns, rows))
    columns, rows = max(1, columns), max(1, rows)
    drawn = lines(map_picture(of, of.bands[0], columns, rows))
    assert 1 <= len(drawn) <= rows
    assert {len(line) for line in drawn} <= set(range(1, columns + 1))
    if not np.isnan(band).any():
        assert " " not in "".join(drawn)
    if np.isnan(band).all():
        assert set("".join(drawn)) == {" "}


def test_a_uniform_field_has_one_colour():
    picture = pixels(view(np.full((8, 8), 0.2)))
    assert {colour for line in picture for colour in line} == {"#48ac93"}


def test_a_few_odd_cells_do_not_decide_the_colours():
    band = np.tile(RAMP, (20, 20))
    band[0, 0] = 50.0
    assert "0.1 " in scale(view(band).bands[0]).plain
    assert scale(view(band).bands[0]).plain.endswith(" 0.4")


def test_the_page():
    text = shown(view())
    assert text.splitlines()[0].strip() == "a mission"
    assert "state  counting" in text
    assert "moisture 0.1" in text
    assert "■ robot" in text
    assert "no map yet" in shown(LiveView("a mission", {"state": "idle"}))


def test_the_maps_of_several_properties_stand_side_by_side():
    of = view()
    both = LiveView(of.title, of.facts, [of.bands[0], LiveBand("salt", 1 - RAMP, of.bands[0].extent)])
    text = shown(both, columns=17, rows=4).splitlines()
    assert sum(line.count("▀") == 16 for line in text) == 4
    assert [line.split()[0] for line in text if "█" in line] == ["moisture", "salt"]


def test_brackets_in_texts_are_shown_as_they_are():
    facts = {"state": "travelling: [red] to node [3] and [/back]", "[bold]": "x"}
    text = shown(LiveView("[i]title", facts))
    assert facts["state"] in text
    assert "[bold]" in text
    assert "[i]title" in text


def test_a_narrow_console_cuts_the_picture_and_keeps_its_lines():
    text = shown(view(), width=5, columns=8, rows=4)
    blocks = [line for line in text.splitlines() if "▀" in line]
    assert len(blocks) == 4
    assert all(line.strip() == "▀▀▀▀▀" for line in blocks)
