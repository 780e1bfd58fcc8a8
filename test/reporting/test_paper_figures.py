# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Figures for publications: what is drawn, widths, embedded fonts."""

from __future__ import annotations

import json
import re
import xml.etree.ElementTree as ET
import zlib
from itertools import islice

import numpy as np
import pytest
from click.testing import CliRunner

pytest.importorskip("matplotlib")

from soilmoist_ros.cli.main import main
from soilmoist_ros.reporting.outputs import mission_run
from soilmoist_ros.reporting.paper_figures import COLUMN_IN, run_figures, write_figures
from soilmoist_ros.simulation import MissionSettings, simulate_mission

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def run():
    settings = MissionSettings(field="patches", strategy="random", dwell="fmi:60", hours=0.3, seed=2)
    return mission_run(simulate_mission(settings))


def streams(pdf):
    parts = [pdf]
    for packed in re.findall(rb"stream\r?\n(.*?)\r?\nendstream", pdf, re.DOTALL):
        try:
            parts.append(zlib.decompress(packed))
        except zlib.error:
            continue
    return b"\n".join(parts)


def test_the_figures_show_the_numbers_of_the_run(run):
    figures = dict(run_figures(run))
    figures["variogram"].draw_without_rendering()
    key = figures["variogram"].axes[0].get_legend()
    assert key.get_window_extent().x1 <= figures["variogram"].bbox.x1, "the names are not cut off"
    assert "above" not in " ".join(text.get_text() for text in key.get_texts())
    assert list(figures) == [
        "map", "sd", "variogram", "track", "course_error", "course_coverage", "course_distance",
    ]  # fmt: skip
    for figure in figures.values():
        assert figure.get_figwidth() == pytest.approx(COLUMN_IN)
    image = figures["map"].axes[0].images[0]
    np.testing.assert_array_equal(np.ma.filled(image.get_array(), np.nan), run.soil_map.vwc)
    assert figures["map"].axes[1].get_ylabel() == "Soil moisture [m³/m³]"
    sd = figures["sd"].axes[0].images[0]
    np.testing.assert_array_equal(np.ma.filled(sd.get_array(), np.nan), run.soil_map.vwc_sd)
    stops = figures["track"].axes[0].collections[0].get_offsets()
    np.testing.assert_allclose(stops, [(visit.x_m, visit.y_m) for visit in run.mission.visits])
    error = figures["course_error"].axes[0].lines[0].get_ydata()
    assert 10 ** error[-1] == pytest.approx(run.mission.series[-1].mse)


def test_files_are_vectors_with_embedded_fonts_and_the_same_every_time(run, tmp_path):
    written = write_figures(tmp_path, islice(run_figures(run), 2), ("pdf", "svg", "pdf"))
    assert len(written) == 4
    before = {path: path.read_bytes() for path in written}
    pdf = streams(before[tmp_path / "figures" / "map.pdf"])
    assert b"/FontFile2" in pdf, "TrueType, embedded"
    assert b"/Type3" not in pdf
    box = [float(value) for value in re.search(rb"/MediaBox \[([^\]]+)\]", pdf)[1].split()]
    assert box[2] / 72 == pytest.approx(COLUMN_IN, rel=1e-3)
    svg = ET.fromstring(before[tmp_path / "figures" / "map.svg"])
    tags = {element.tag.rpartition("}")[2] for element in svg.iter()}
    assert "text" not in tags, "letters are outlines and need no font"
    assert {"path", "image"} <= tags
    write_figures(tmp_path, islice(run_figures(run), 2), ("pdf",))
    now = sorted((tmp_path / "figures").iterdir())
    assert [path.suffix for path in now] == [".pdf"] * 2, "those of an earlier run are gone"
    assert all(path.read_bytes() == before[path] for path in now)
    assert write_figures(tmp_path, (), ()) == []
    assert list((tmp_path / "figures").iterdir()) == []


def test_commands_write_figures_of_missions_and_seasons(tmp_path):
    def command(*words):
        result = CliRunner().invoke(main, list(map(str, words)))
        assert result.exit_code == 0, result.output
        return result

    for seed in (1, 2):
        choices = ("--field", "patches", "--strategy", "random", "--dwell", "fmi:60", "--hours", "0.2")
        figures = ("--figures", "svg") if seed == 1 else ()
        command("simulate", *choices, "--seed", seed, *figures, "--out", tmp_path / f"run{seed}")
    assert (tmp_path / "run1" / "figures" / "map.svg").is_file()
    season = ("season", tmp_path / "run1", tmp_path / "run2", "--figures", "pdf", "--out", tmp_path / "season")
    answer = json.loads(command(*season, "--json").stdout)
    assert answer["summary"]["kind"] == "season"
    assert {path.name for path in (tmp_path / "season" / "figures").iterdir()} == {"season.pdf", "maps.pdf"}
