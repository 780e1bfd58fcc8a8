# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""One property of a simulated mission: its truth, and the map of its counts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.exploration import Visit, planning_grid
from soilmoist_ros.foundation import InputError
from soilmoist_ros.mapping import (
    Covariates,
    EarlierSurvey,
    Field,
    FieldGrid,
    FieldMap,
    FieldMapSettings,
    Knowledge,
    MapState,
    SoilMap,
    default_merge_radius_m,
)
from soilmoist_ros.sensing import CountRecord, MoistureCurve
from soilmoist_ros.simulation.fields.catalogue import surrogate_field
from soilmoist_ros.simulation.fields.surrogate_field import SurrogateField
from soilmoist_ros.simulation.mission.mission_result import MapErrors, MappedProperty, map_errors
from soilmoist_ros.simulation.mission.settings import MissionSettings, PropertySettings
from soilmoist_ros.simulation.mission.simulated_knowledge import earlier_series, simulated_covariates
from soilmoist_ros.simulation.mission.streams import field_stream

Array = NDArray[np.float64]


class Channel:
    """Maps one property for all robots of a mission.

    :param earlier: earlier surveys that inform the map, in addition to the surveys of the settings
    :param covariates: covariates that inform the map, in addition to the covariates of the settings
    :param whole: whether every map is of all cells; otherwise only the last one is, the others are of cells that
        represent the field
    """

    def __init__(
        self,
        field: SurrogateField,
        grid: FieldGrid,
        settings: MissionSettings,
        curve: MoistureCurve | None,
        wanted: PropertySettings,
        number: int = 0,
        earlier: Sequence[EarlierSurvey] = (),
        covariates: Covariates | None = None,
        whole: bool = True,
    ) -> None:
        self.field = field
        self.grid = grid
        self.wanted = wanted
        self.curve = curve
        self._of_stops = settings.map_from == "stops"
        choices = FieldMapSettings.chosen(settings, curve=curve, footprint_radius_m=settings.footprint_m)
        self.series = earlier_series(field, grid, settings, number)
        merge_m = default_merge_radius_m(grid, choices.margin_m)
        surveys = (one.survey(merge_m, choices.sample_radius_m) for one in self.series)
        covariates = Covariates.joined(covariates, simulated_covariates(field, grid, settings, number))
        mapped = grid if whole else planning_grid(grid)
        self.field_map = FieldMap(mapped, choices, Knowledge((*earlier, *surveys), covariates))
        self.drift = settings.rate_drift
        self._truth = field.rate_at(grid.cells)
        self._mapped = mapped.mask[grid.mask]
        self._errors: MapErrors | None = MapErrors()
        self._scored_s = 0.0
        self.soil_map: SoilMap | None = None  # the last one
        self._noted: tuple[MapState, float] | None = None
        self.records: list[CountRecord] = []  # in order of time

    def take(self, record: CountRecord) -> None:
        """Add a record."""
        self.records.append(record)
        if not self._of_stops:
            self.field_map.add(record)

    def take_stop(self, now_s: float, visit: Visit, counted: Sequence[CountRecord], warmed_up: bool) -> None:
        """Add a complete visit with its records to a map of stops; ``warmed_up``: there are enough for a map."""
        raw_counts = sum(record.raw_counts for record in counted)
        exposure_s = sum(record.effective_exposure_s for record in counted)
        self.field_map.add_sample((visit.x_m, visit.y_m), raw_counts, exposure_s)
        if warmed_up:
            self._update(now_s)

    def update(self, now_s: float) -> None:
        """Update a map of all records."""
        if not self._of_stops:
            self._update(now_s)

    def update_later(self, now_s: float) -> None:
        """Note the state of a map of all records, for :meth:`catch_up`."""
        if not self._of_stops:
            self._noted = (self.field_map.state, now_s)

    def catch_up(self) -> None:
        """Update the map to the state that was noted last, as if it had been updated then."""
        if self._noted is not None:
            self._update(self._noted[1], self._noted[0])
            self._noted = None

    def truth(self, now_s: float) -> Array:
        """True rate in the cells at a time, shape (g,) [counts/s]."""
        return self._truth * self.drift.factor(now_s)

    def _update(self, now_s: float, state: MapState | None = None) -> None:
        self._score(now_s, self.field_map.update(state))

    def finish(self, now_s: float) -> None:
        """Make the last map, which is of all cells."""
        self.update(now_s)
        if self.field_map.soil_map is not None and not self._mapped.all():
            self._score(now_s, self.field_map.compute(self.field_map.state, grid=self.grid))

    def _score(self, now_s: float, soil_map: SoilMap | None) -> None:
        """Keep a new map, whose errors are those at this time."""
        if soil_map is not None:
            self.soil_map, self._scored_s, self._errors = soil_map, now_s, None

    @property
    def errors(self) -> MapErrors:
        """Errors of the last map, in its cells."""
        if self._errors is None:
            assert self.soil_map is not None
            mask, truth = self.soil_map.grid.mask, self.truth(self._scored_s)
            true_rate = truth if len(truth) == np.count_nonzero(mask) else truth[self._mapped]
            sd = np.sqrt(self.soil_map.variance[mask])
            self._errors = map_errors(self.soil_map.rate[mask], sd, true_rate, self.curve)
        return self._errors

    def mapped(self, now_s: float) -> MappedProperty:
        """The property as a part of the result of a mission that ends now."""
        return MappedProperty(
            self.wanted.name, self.field.title, tuple(self.records), self.soil_map,
            self.grid.to_raster(self.truth(now_s)), self.wanted.weight, tuple(self.series),
            self.field_map.knowledge.covariates,
        )  # fmt: skip


def mission_properties(settings: MissionSettings) -> tuple[PropertySettings, ...]:
    """All properties that a mission measures; the first belongs to the mission field."""
    return PropertySettings(settings.field), *settings.properties


def mission_fields(settings: MissionSettings) -> list[SurrogateField]:
    """The fields of :func:`mission_properties`.

    :raises InputError: if a field is unknown, does not cover the mission field, or occurs twice
    """
    fields, names = list[SurrogateField](), set[str]()
    for number, wanted in enumerate(mission_properties(settings)):
        rng = field_stream(settings.seed, number) if settings.random_field else None
        if isinstance(wanted.field, str):
            fields.append(surrogate_field(wanted.field, rng))
        elif rng is None:
            fields.append(wanted.field)
        else:
            raise InputError(f"the field {wanted.field_name!r} is given as it is", "leave out random_field")
        if number == 0:
            continue
        if not _covers(fields[-1].field, fields[0].field):
            raise InputError(
                f"the field {wanted.field_name!r} of a property does not cover the field {fields[0].name!r}",
                "choose a field with the same datum and a boundary that contains it",
            )
        if wanted.name in names:
            raise InputError(f"two properties have the name {wanted.name!r}", "give each property once")
        names.add(wanted.name)
    return fields


def _covers(ground: Field, field: Field) -> bool:
    import shapely

    here, there = (np.array([one.frame.latitude_deg, one.frame.longitude_deg]) for one in (ground, field))
    around = shapely.Polygon(ground.polygon).buffer(1e-6)
    return np.allclose(here, there, rtol=0, atol=1e-9) and bool(around.covers(shapely.Polygon(field.polygon)))
