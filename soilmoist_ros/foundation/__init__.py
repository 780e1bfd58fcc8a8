# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Errors with a remedy, configuration files, geodesy and health; imports no other folder of the package."""

from typing import TYPE_CHECKING

from soilmoist_ros.foundation.registry import open_door as open_door

if TYPE_CHECKING:
    from soilmoist_ros.foundation.configuration import config_folder as config_folder
    from soilmoist_ros.foundation.configuration import parse_yaml as parse_yaml
    from soilmoist_ros.foundation.configuration import read_limited as read_limited
    from soilmoist_ros.foundation.configuration import read_lines as read_lines
    from soilmoist_ros.foundation.configuration import read_quickly as read_quickly
    from soilmoist_ros.foundation.configuration import read_yaml as read_yaml
    from soilmoist_ros.foundation.configuration import resource as resource
    from soilmoist_ros.foundation.configuration import resource_names as resource_names
    from soilmoist_ros.foundation.errors import Health as Health
    from soilmoist_ros.foundation.errors import IllConditionedError as IllConditionedError
    from soilmoist_ros.foundation.errors import InputError as InputError
    from soilmoist_ros.foundation.errors import Level as Level
    from soilmoist_ros.foundation.errors import Mistake as Mistake
    from soilmoist_ros.foundation.errors import SoilmoistError as SoilmoistError
    from soilmoist_ros.foundation.errors import did_you_mean as did_you_mean
    from soilmoist_ros.foundation.errors import listing as listing
    from soilmoist_ros.foundation.geodesy import LatLon as LatLon
    from soilmoist_ros.foundation.geodesy import LocalFrame as LocalFrame
    from soilmoist_ros.foundation.geodesy import PlaneMove as PlaneMove
    from soilmoist_ros.foundation.geodesy import coordinates_text as coordinates_text
    from soilmoist_ros.foundation.geodesy import direction as direction
    from soilmoist_ros.foundation.geodesy import distance_and_bearing as distance_and_bearing
    from soilmoist_ros.foundation.geodesy import distance_text as distance_text
    from soilmoist_ros.foundation.geodesy import fit_move as fit_move
    from soilmoist_ros.foundation.geodesy import floats as floats
    from soilmoist_ros.foundation.geodesy import move_between as move_between
    from soilmoist_ros.foundation.geodesy import other_datum as other_datum
    from soilmoist_ros.foundation.geodesy import place_text as place_text
    from soilmoist_ros.foundation.geodesy import squared_distances as squared_distances
    from soilmoist_ros.foundation.geodesy import town_distance_m as town_distance_m
    from soilmoist_ros.foundation.geodesy import town_text as town_text
    from soilmoist_ros.foundation.plain_values import DAY_S as DAY_S
    from soilmoist_ros.foundation.plain_values import HECTARE_M2 as HECTARE_M2
    from soilmoist_ros.foundation.plain_values import area as area
    from soilmoist_ros.foundation.plain_values import area_unit as area_unit
    from soilmoist_ros.foundation.plain_values import csv_text as csv_text
    from soilmoist_ros.foundation.plain_values import duration as duration
    from soilmoist_ros.foundation.plain_values import finite_number as finite_number
    from soilmoist_ros.foundation.plain_values import foreign_text as foreign_text
    from soilmoist_ros.foundation.plain_values import nan_as_text as nan_as_text
    from soilmoist_ros.foundation.plain_values import number as number
    from soilmoist_ros.foundation.plain_values import printable as printable
    from soilmoist_ros.foundation.plain_values import read_json as read_json
    from soilmoist_ros.foundation.plain_values import shown_path as shown_path
    from soilmoist_ros.foundation.plain_values import shown_text as shown_text
    from soilmoist_ros.foundation.plain_values import text_of_csv as text_of_csv
    from soilmoist_ros.foundation.registry import Registry as Registry
    from soilmoist_ros.foundation.registry import install as install
    from soilmoist_ros.foundation.registry import is_installed as is_installed
    from soilmoist_ros.foundation.registry import not_installed as not_installed
    from soilmoist_ros.foundation.registry import optional_module as optional_module
    from soilmoist_ros.foundation.sections import Section as Section
    from soilmoist_ros.foundation.sections import line_of as line_of
    from soilmoist_ros.foundation.sections import load_model as load_model
    from soilmoist_ros.foundation.version import __version__ as __version__
    from soilmoist_ros.foundation.workers import THREADS as THREADS
    from soilmoist_ros.foundation.workers import Batches as Batches
    from soilmoist_ros.foundation.workers import connect as connect
    from soilmoist_ros.foundation.workers import cores as cores
    from soilmoist_ros.foundation.workers import one_thread_each as one_thread_each
    from soilmoist_ros.foundation.workers import shared_work as shared_work

__getattr__, __dir__, __all__ = open_door(
    __name__,
    {
        "configuration": "config_folder parse_yaml read_limited read_lines read_quickly read_yaml resource resource_names",
        "errors": "Health IllConditionedError InputError Level Mistake SoilmoistError did_you_mean listing",
        "geodesy": "LatLon LocalFrame PlaneMove coordinates_text direction distance_and_bearing distance_text fit_move floats move_between other_datum place_text squared_distances town_distance_m town_text",
        "plain_values": "DAY_S HECTARE_M2 area area_unit csv_text duration finite_number foreign_text nan_as_text number printable read_json shown_path shown_text text_of_csv",
        "registry": "Registry install is_installed not_installed optional_module",
        "sections": "Section line_of load_model",
        "version": "__version__",
        "workers": "Batches THREADS connect cores one_thread_each shared_work",
    },
)
