# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Errors with a remedy, configuration files, geodesy and health; imports no other folder of the package."""

from typing import TYPE_CHECKING

from soilmoist_ros.foundation.registry import open_door as open_door

if TYPE_CHECKING:
    # fmt: off
    from soilmoist_ros.foundation.configuration import config_folder as config_folder, parse_yaml as parse_yaml, read_limited as read_limited, read_lines as read_lines, read_quickly as read_quickly, read_yaml as read_yaml, resource as resource, resource_names as resource_names
    from soilmoist_ros.foundation.errors import Health as Health, IllConditionedError as IllConditionedError, InputError as InputError, Level as Level, Mistake as Mistake, SoilmoistError as SoilmoistError, did_you_mean as did_you_mean, listing as listing
    from soilmoist_ros.foundation.geodesy import LatLon as LatLon, LocalFrame as LocalFrame, PlaneMove as PlaneMove, coordinates_text as coordinates_text, direction as direction, distance_and_bearing as distance_and_bearing, distance_text as distance_text, fit_move as fit_move, floats as floats, move_between as move_between, other_datum as other_datum, squared_distances as squared_distances
    from soilmoist_ros.foundation.plain_values import DAY_S as DAY_S, HECTARE_M2 as HECTARE_M2, area as area, area_unit as area_unit, csv_text as csv_text, duration as duration, finite_number as finite_number, foreign_text as foreign_text, nan_as_text as nan_as_text, number as number, printable as printable, read_json as read_json, shown_path as shown_path, shown_text as shown_text, text_of_csv as text_of_csv, thousands as thousands
    from soilmoist_ros.foundation.registry import Registry as Registry, install as install, is_installed as is_installed, not_installed as not_installed, optional_module as optional_module
    from soilmoist_ros.foundation.sections import Section as Section, line_of as line_of, load_model as load_model
    from soilmoist_ros.foundation.version import __version__ as __version__
    from soilmoist_ros.foundation.workers import THREADS as THREADS, Batches as Batches, cores as cores, one_thread_each as one_thread_each
    # fmt: on

__getattr__, __dir__, __all__ = open_door(
    __name__,
    {
        "configuration": "config_folder parse_yaml read_limited read_lines read_quickly read_yaml resource resource_names",
        "errors": "Health IllConditionedError InputError Level Mistake SoilmoistError did_you_mean listing",
        "geodesy": "LatLon LocalFrame PlaneMove coordinates_text direction distance_and_bearing distance_text fit_move floats move_between other_datum squared_distances",
        "plain_values": "DAY_S HECTARE_M2 area area_unit csv_text duration finite_number foreign_text nan_as_text number printable read_json shown_path shown_text text_of_csv thousands",
        "registry": "Registry install is_installed not_installed optional_module",
        "sections": "Section line_of load_model",
        "version": "__version__",
        "workers": "Batches THREADS cores one_thread_each",
    },
)
