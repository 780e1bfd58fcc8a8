# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

pytest.importorskip("rclpy")

from soilmoist_ros.mapping.covariates import CovariateSource
from soilmoist_ros.mapping.field import load_field
from soilmoist_ros.nodes.system.demo_configuration import DemoSettings, write_configuration
from soilmoist_ros.recording.run_folder import CONFIGURATION, read_parameters
from soilmoist_ros.simulation import MissionSettings, PropertySettings, surrogate_field


def test_mapper_and_planner_know_the_same_earlier_runs_and_other_properties_have_none(tmp_path):
    mission = MissionSettings(field="smooth", properties=(PropertySettings("rough"),))
    settings = DemoSettings(tmp_path, mission, earlier=(tmp_path / "may", tmp_path / "june"))
    write_configuration(settings, surrogate_field("smooth"), tmp_path)
    wanted = [str(tmp_path / "may"), str(tmp_path / "june")]
    for node, expected in (("mapper", wanted), ("planner", wanted), ("rough/mapper", None)):
        assert read_parameters(tmp_path / CONFIGURATION, node).get("earlier") == expected


def test_all_mappers_and_planners_know_the_covariates(tmp_path):
    settings = DemoSettings(
        tmp_path,
        MissionSettings(field="smooth", properties=(PropertySettings("rough"),)),
        covariates=(CovariateSource(tmp_path / "relief.tif", "slope"),),
    )
    field = surrogate_field("smooth")
    of_field = CovariateSource(tmp_path / "image.tif", "2", name="ndvi")
    field = replace(field, field=replace(field.field, covariates=(of_field,)))
    write_configuration(settings, field, tmp_path)
    for node in ("mapper", "planner", "rough/mapper"):
        had = read_parameters(tmp_path / CONFIGURATION, node)
        assert had["covariates"] == [f"{tmp_path / 'relief.tif'}:slope"]
        assert load_field(Path(had["field"])).covariates == (of_field,)
