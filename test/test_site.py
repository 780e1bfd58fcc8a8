# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The site of the documentation: builds without warnings, and finds what is wrong."""

import json
import logging
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

pytest.importorskip("mkdocs", reason="the site needs requirements-docs.txt")

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="module")
def pages(load_script):
    return load_script("site_pages.py")


@pytest.mark.slow
@pytest.mark.process
def test_the_site_builds_without_a_warning(tmp_path):
    build = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", tmp_path / "site"],
        cwd=ROOT, env=os.environ | {"NO_MKDOCS_2_WARNING": "1"}, capture_output=True, text=True, timeout=300,
    )  # fmt: skip
    assert (build.returncode, build.stdout, build.stderr) == (0, "", "")
    site = tmp_path / "site"
    assert "--until-sd" in (site / "command_line.html").read_text()
    assert "PoissonKriging" in (site / "api/mapping.html").read_text()
    index = json.loads((site / "search/search_index.js").read_text().partition("=")[2].rstrip().rstrip(";"))
    farm = "".join(entry["text"] for entry in index["docs"] if entry["location"].startswith("farmer.html")).lower()
    assert [word for word in ("irrigate", "dose", "watering", "dry spots", "wet spots") if word not in farm] == []
    assert 'class="made"' in (site / "benchmarks.html").read_text(), "how a table was made"


def checked(pages, folder, caplog, **files):
    for name, text in files.items():
        (folder / f"{name}.html").write_text(text)
    caplog.clear()
    with caplog.at_level(logging.WARNING):
        pages.on_post_build(SimpleNamespace(site_dir=str(folder)))
    return [record.getMessage() for record in caplog.records]


def test_links_that_lead_nowhere_are_found(pages, tmp_path, caplog):
    good = '<h2 id="top">x</h2><a href="b.html#there">x</a><a href="#top">x</a><a href="https://elsewhere">x</a>'
    assert checked(pages, tmp_path, caplog, a=good, b='<p id="there">') == []
    assert checked(pages, tmp_path, caplog, a='<a class="x" href="c.html">x</a>') == [
        "a.html has a link to c.html, which is not there"
    ]
    assert checked(pages, tmp_path, caplog, a='<a href="b.html#gone">x</a>') == [
        "a.html has a link to b.html#gone, which has no such anchor"
    ]


def test_what_comes_from_the_network_is_found(pages, tmp_path, caplog):
    assert checked(pages, tmp_path, caplog, a='<script async src="https://elsewhere/x.js">') == [
        "a.html loads https://elsewhere/x.js from the network"
    ]


def test_names_in_tables_break_after_their_parts(pages):
    table = '<td style="x"><code>sensor_msgs/Fix</code>, a_b <code>&quot;r_1&quot;</code></td><code>a_b</code>'
    parts = pages.on_post_page(table, None, None).split("<wbr>")
    assert parts[:2] == ['<td style="x"><code>sensor_', "msgs/"]
    assert parts[2:] == ["Fix</code>, a_b <code>&quot;r_", "1&quot;</code></td><code>a_b</code>"]


def test_a_notebook_becomes_a_page(pages, tmp_path):
    picture = {"output_type": "display_data", "data": {"image/png": "AAEC", "text/plain": "<Figure>"}}
    cells = [
        {"cell_type": "markdown", "source": ["# Title\n", "text"]},
        {
            "cell_type": "code",
            "source": "print(1)",
            "outputs": [{"output_type": "stream", "text": ["1\n"]}, picture],
        },
    ]
    path = tmp_path / "walk.ipynb"
    path.write_text(json.dumps({"cells": cells}))
    text, pictures = pages.notebook(path)
    assert text.startswith("# Title\ntext\n\n```python\nprint(1)\n```\n\n")
    assert "1\n```\n\n![output of the code above](walk_1.png)\n" in text
    assert pictures == {"walk_1.png": b"\x00\x01\x02"}


def test_files_outside_the_folder_of_pages_have_a_page(pages):
    assert pages.site_uri("docs/robot.md") == "robot.md"
    assert pages.site_uri("config/sites/example.yaml") == "files/config/sites/example.yaml.md"
    assert pages.content("config/sites/example.yaml").startswith("# config/sites/example.yaml\n\n```yaml\n")
    for uri in ("robot.md", "CONTRIBUTING.md", "examples/README.md"):
        assert pages.site_uri(pages.repository_path(uri)) == uri


def test_the_changelog_is_markdown(pages):
    text = pages.changes()
    assert text.startswith("# Changes\n")
    assert "\n## Forthcoming\n" in text
    assert "``" not in text
