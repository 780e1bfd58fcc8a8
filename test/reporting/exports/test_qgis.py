# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""QGIS projects: qgis.py. QGIS itself is not needed."""

from __future__ import annotations

import zipfile
from xml.etree import ElementTree as ET

import pyogrio
import pyogrio.raw
import pytest
import rasterio
from shapely import from_wkb

from soilmoist_ros.reporting.colours import UNCERTAIN, hex_ramp
from soilmoist_ros.reporting.exports.qgis import write_qgis, write_run_project
from soilmoist_ros.reporting.exports.source import ExportSettings

pytestmark = pytest.mark.slow  # the run that all export takes long to make


@pytest.fixture(scope="module")
def written(exported, tmp_path_factory):
    return write_qgis(exported.source, tmp_path_factory.mktemp("qgis"), ExportSettings())


@pytest.fixture(scope="module")
def project(written):
    with zipfile.ZipFile(written[-1]) as archive:
        return ET.fromstring(archive.read("soilmoist.qgs"))


def test_every_layer_of_the_project_is_in_its_files(written, project):
    assert [path.name for path in written] == ["soilmoist.gpkg", "map.tif", "map_salt.tif", "soilmoist.qgz"]
    known = {name for name, _ in pyogrio.list_layers(written[0])}
    sources = [element.text for element in project.iter("datasource")]
    in_package = {source.partition("|layername=")[2] for source in sources if "gpkg" in source}
    assert in_package == known
    assert [source for source in sources if "gpkg" not in source] == ["./map.tif"] * 2 + ["./map_salt.tif"] * 2
    tree = [element.get("id") for element in project.iter("layer-tree-layer")]
    assert tree == [element.findtext("id") for element in project.iter("maplayer")]
    assert all(
        element.findtext("srs/spatialrefsys/authid") == "EPSG:32630" for element in project.iter("maplayer")
    )
    shown = {e.get("name") for e in project.iter("layer-tree-layer") if e.get("checked") == "Qt::Checked"}
    assert "Soil moisture [% by volume]" in shown


@pytest.fixture(scope="module")
def beside(exported, tmp_path_factory):
    """The project beside the files of a run; its layers by name."""
    path = tmp_path_factory.mktemp("beside") / "soilmoist.qgs"
    root = ET.parse(write_run_project(path, "Farm", exported.source.properties)).getroot()
    return {layer.findtext("id").removeprefix("soilmoist_"): layer for layer in root.iter("maplayer")}


def test_the_project_beside_a_run_finds_its_files(beside, exported):
    found = {}
    for name, layer in beside.items():
        path, *options = layer.findtext("datasource").split("|")
        assert path.startswith("./")  # the folder may move
        assert layer.find("srs/spatialrefsys/wkt").text  # without it QGIS does not place the layer
        if options:
            chosen = dict(option.split("=", 1) for option in options)
            _, _, wkb, _ = pyogrio.raw.read(
                exported.folder / path, layer=chosen["layername"], where=chosen["subset"]
            )
            kinds = {shape.geom_type.removeprefix("Multi") for shape in from_wkb(wkb)}
            assert kinds <= {chosen["geometrytype"]}
            found[name] = len(wkb)
        else:
            assert (exported.folder / path).is_file()
    assert found["field"] == found["track"] == 1
    assert found["samples"] == found["samples_salt"] == len(exported.source.properties[0].samples["vwc"])


def test_the_project_beside_a_run_shows_value_and_standard_deviation(beside, exported):
    for one in exported.source.properties:
        for end, colours in (("", one.quantity.colours), ("_sd", UNCERTAIN)):
            renderer = beside[f"map{one.suffix}{end}"].find("pipe/rasterrenderer")
            with rasterio.open(exported.folder / f"map{one.suffix}.tif") as raster:
                assert raster.descriptions[int(renderer.get("band")) - 1] == one.quantity.band + end
            ramp = [item.get("color") for item in renderer.iter("item")]
            assert ramp == hex_ramp(colours, len(ramp))
