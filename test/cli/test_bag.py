# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``soilmoist bag``: info, verify, recover."""

import json
import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner

from soilmoist_ros.cli.bag import command

GOLDEN = Path(__file__).resolve().parent.parent / "golden" / "one_stop" / "bag"


@pytest.fixture
def bag(tmp_path):
    return shutil.copytree(GOLDEN, tmp_path / "run" / "bag").parent


@pytest.mark.slow
def test_a_bag_is_recovered_and_verified_and_damage_is_named(bag, tmp_path):
    run = CliRunner().invoke
    done = run(command, ["recover", str(bag), "--out", str(tmp_path / "recovered")])
    assert done.exit_code == 0, done.output
    done = run(command, ["verify", str(bag), str(tmp_path / "recovered")])
    assert done.exit_code == 0
    assert done.output.count("whole") == 2
    assert "right checksums of 2 files" in done.output
    path = tmp_path / "recovered" / "recovered_0.mcap"
    (found,) = json.loads(run(command, ["verify", str(path.parent), "--json"]).stdout)["bags"]
    assert (found["bag"], found["paths"]) == (str(path.parent), [str(path)]), "as in 0.2.0"
    data = bytearray(path.read_bytes())
    data[data.index(b"zstd") + 40] ^= 1
    path.write_bytes(data)
    done = run(command, ["verify", str(tmp_path / "recovered")])
    assert done.exit_code == 1
    for text in ("its checksum is another one", "is damaged in 1 place", "and metadata.yaml says"):
        assert text in done.output
    done = run(command, ["info", str(tmp_path / "recovered")])
    assert done.exit_code == 1
    assert "soilmoist bag recover" in done.output
