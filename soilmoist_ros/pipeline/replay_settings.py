# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Choices of a replay, and the maps that they and the parameters of the run open."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, get_args

from soilmoist_ros.foundation import InputError
from soilmoist_ros.mapping import VARIOGRAM_MODELS, DriftModel, FitMethod, LocalModel, NoiseModel
from soilmoist_ros.pipeline.properties import PropertyTopic
from soilmoist_ros.recording import read_parameters
from soilmoist_ros.reporting import FieldSurvey, Note, NoteCode, open_survey
from soilmoist_ros.sensing import load_site

Source = Literal["counts", "raw"]

_OPTIONS = ("cell_m", "model", "fit", "noise", "local", "drift_model", "keep_nugget", "merge_radius_m")


@dataclass(frozen=True)
class ReplaySettings:
    """Choices of a replay; ``None`` keeps the mapper's setting.

    :param field: field file, or name of a shipped one
    :param site: site file, or name of a shipped one; other corrections need the source ``raw``
    :param properties: names of the properties to map; empty for all in the bag
    :param truths: surrogate fields to compare with, by name of the property or its index in the list of
        properties, from 0; built-in names, or field files with a truth
    :param model: variogram model
    :param fit: how the variogram is fitted
    :param noise: rate in the Poisson noise
    :param local: whether the variance may differ from place to place
    :param drift_model: whether the mean rate may change during the survey
    :param keep_nugget: map the rate with its micro-scale variation, or the smooth part only
    :param merge_radius_m: records closer together than this become one sample [m]
    :param cell_m: cell size of the map [m]
    :param counts_topic: topic with the records
    :param source: ``counts`` maps the records as the driver corrected and placed them; ``raw`` corrects and
        places the lines of logger and receiver (``raw/logger``, ``raw/gnss``) again
    :param logger_topic: topic with the raw lines of the logger, which are the source then; ``raw/logger`` if empty
    :param fix_topic: topic with the positions of the raw lines: fixes or NMEA; ``raw/gnss``, or ``fix``, if empty
    :param gnss_shift_s: time added to those of the positions of the raw lines [s]
    :param logger: format of the raw lines of the logger; detected from their header if ``None``
    :param earlier: earlier runs of the field, see :func:`read_earlier_runs`; ``None`` for those of the robot
    :param crs: coordinate reference system of the outputs, checked before the work; ``None`` for the UTM zone
    :param covariates: files with covariates as FILE or FILE:BAND, in addition to those of the field; ``None`` for
        those of the robot
    :param reference: log of a stationary sensor that counted during the run
    """

    field: str | None = None
    site: str | None = None
    properties: Sequence[str] = ()
    truths: Mapping[str | int, str] = dataclasses.field(default_factory=dict)
    model: str | None = None
    fit: str | None = None
    noise: str | None = None
    local: str | None = None
    drift_model: str | None = None
    keep_nugget: bool | None = None
    merge_radius_m: float | None = None
    cell_m: float | None = None
    counts_topic: str = "counts"
    source: Source = "counts"
    logger: str | None = None
    logger_topic: str = ""
    fix_topic: str = ""
    gnss_shift_s: float = 0.0
    crs: str | None = None
    earlier: Sequence[Path | str] | None = None
    covariates: Sequence[str] | None = None
    reference: Path | None = None

    @property
    def from_lines(self) -> bool:
        """Whether the raw lines are the source."""
        return self.source == "raw" or bool(self.logger_topic)


def robot_survey(bag: Path, configuration: Path | None, chosen: ReplaySettings) -> tuple[FieldSurvey, list[Note]]:
    """The map of the robot's own records, still without records, and remarks for the user."""
    had = read_parameters(configuration, "mapper")
    survey = _open(bag, had, chosen, had.get("site", "") if chosen.site is None else chosen.site)
    if chosen.from_lines or not chosen.site or not had.get("site"):
        return survey, []
    recorded = load_site(had["site"]).corrections
    if recorded == survey.site.corrections:
        return survey, []
    corrected = survey.site.model_copy(update={"corrections": recorded})
    message = "The counts are corrected as on the robot, not as this site file says: that needs the raw lines."
    return replace(survey, site=corrected), [Note(NoteCode.OTHER_CORRECTIONS, message)]


def _open(bag: Path, had: Mapping[str, Any], chosen: ReplaySettings, site: str, name: str = "") -> FieldSurvey:
    """A map without records: the mapper's settings, overridden by the user's choices.

    :param had: parameters of the mapper
    :param name: name of the property; empty for the robot's own
    """
    field_file = chosen.field or had.get("field")
    if not field_file:
        raise InputError("does not say which field it is of", "give the field file with --field", bag)
    options: dict[str, Any] = {name: had[name] for name in (*_OPTIONS, "simulated") if name in had}
    if had:
        options.setdefault("noise", "mean")  # mappers of earlier versions had no choice
        options.setdefault("local", "off")
        options.setdefault("drift_model", "off")
    options |= {name: value for name in _OPTIONS if (value := getattr(chosen, name)) is not None}
    for option, known in (
        ("model", VARIOGRAM_MODELS.names()),
        ("fit", get_args(FitMethod)),
        ("noise", get_args(NoiseModel)),
        ("local", get_args(LocalModel)),
        ("drift_model", get_args(DriftModel)),
    ):
        if options.get(option, known[0]) not in known:
            raise InputError(f"there is no {option} {options[option]!r}", f"choose one of: {', '.join(known)}")
    earlier = had.get("earlier", ()) if chosen.earlier is None else chosen.earlier
    covariates = had.get("covariates", ()) if chosen.covariates is None else chosen.covariates
    try:
        return open_survey(field_file, site, **options, earlier=earlier, property_name=name, covariates=covariates)
    except ValueError as error:
        raise InputError(str(error), "change this setting") from None


def property_survey(
    one: PropertyTopic, bag: Path, configuration: Path | None, chosen: ReplaySettings
) -> FieldSurvey:
    """The map of a property with its mapper's settings, without records.

    If the bag lacks the mapper's parameters, the settings of the robot's own map apply, but without the site: a
    calibration belongs to one sensor.
    """
    had = read_parameters(configuration, one.mapper)
    had = had or {**read_parameters(configuration, "mapper"), "site": ""}
    return _open(bag, had, chosen, had.get("site", ""), one.name)
