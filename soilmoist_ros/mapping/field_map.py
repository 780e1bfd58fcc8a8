# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The map of a field that grows: records or samples go in, and any state of them has its map."""

from __future__ import annotations

import math
from bisect import insort
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from datetime import UTC, datetime
from functools import cached_property
from operator import attrgetter
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import InputError
from soilmoist_ros.mapping.drift import (
    NO_CHANGE,
    WINDOW_S,
    Change,
    Changing,
    DriftModel,
    TimedSamples,
    find_change,
)
from soilmoist_ros.mapping.expected_counts import ExpectedCounts, Held
from soilmoist_ros.mapping.grid import FieldGrid
from soilmoist_ros.mapping.joint_fit import JointModel
from soilmoist_ros.mapping.knowledge import NOTHING, Knowledge
from soilmoist_ros.mapping.kriging.poisson_kriging import PoissonKriging
from soilmoist_ros.mapping.kriging.system import Progress
from soilmoist_ros.mapping.mapping_settings import MappingSettings
from soilmoist_ros.mapping.records import (
    UNEXPECTED,
    DrivenPaths,
    SampleMerger,
    Skip,
    SkippedRecords,
    check_record,
    driven_spreads,
    survey_samples,
    without_verdict,
)
from soilmoist_ros.mapping.samples import NO_SAMPLES, Samples, as_samples
from soilmoist_ros.mapping.soil_map import MAX_EXACT_SAMPLES, SoilMap, make_soil_map
from soilmoist_ros.mapping.variogram.farm_prior import FarmPrior
from soilmoist_ros.mapping.variogram.fit import FitMethod, NoiseModel, VariogramFit, estimate_variogram
from soilmoist_ros.mapping.variogram.model import ModelName, Variogram
from soilmoist_ros.sensing import CountRecord, MoistureCurve

if TYPE_CHECKING:
    from shapely.geometry import MultiPolygon, Polygon

Array = NDArray[np.float64]
_Some = TypeVar("_Some", Samples, TimedSamples, None)
_Made = TypeVar("_Made")

OBJECTION = 2.0  # loss of log-likelihood from which on the counts object to a footprint
_WEIGHED_PLACES = 200  # number of samples by which a footprint is weighed; of more, every k-th is used
REFIT_GROWTH = 0.1
"""Relative growth of samples or exposure after which the variogram is refitted: always while they are few."""
LATER_REFIT_GROWTH, MANY_SAMPLES = 0.2, 40
"""Relative growth after which the variogram is refitted, from this number of samples on."""
SEARCH_GROWTH = 0.5
"""Relative growth after which direction and start values of the variogram are searched again."""
CHANGE_GROWTH = 0.05
"""Relative growth after which the drift of the mean rate, and with it the time of the map, is refitted."""
RECENT_GROWTH = 1.3
"""Growth of the number of samples up to which a variogram is good enough to judge single records."""
RECENT = 30  # number of last records by which the stream of records is judged
_MEDIANS = attrgetter("f_pressure", "f_humidity", "x_m", "y_m")


@dataclass(frozen=True)
class FieldMapSettings:
    """Choices of a :class:`FieldMap`.

    Settings not named here are of :class:`MappingSettings`, with its defaults.

    :param margin_m: records up to this far outside the field count [m], >= 0; they inform its edge
    :param curve: calibration that turns the rate into soil moisture; without one the map is of the rate only
    :param footprint_radius_m: radius of the footprint over which the records were counted [m], >= 0; 0 if it is
        not known, and for a sensor that sees its own place only
    :param deconvolve: whether the map is of the rate at each place (true), or of its mean over the footprint
        around the place (false); ``None`` for each place unless the counts object (:func:`fits_footprint`). With
        soft_l1 it is always the mean
    """

    model: ModelName = "matern32"
    fit: FitMethod = "reml"
    keep_nugget: bool = True
    merge_radius_m: float | None = None
    margin_m: float = 10.0
    curve: MoistureCurve | None = None
    footprint_radius_m: float = 0.0
    noise: NoiseModel = "local"
    drift_model: DriftModel = "auto"
    deconvolve: bool | None = None
    prior: str | None = None

    @classmethod
    def chosen(cls, settings: object, **more: Any) -> FieldMapSettings:
        """The choices of :class:`MappingSettings` that other settings have too, such as those of a mission."""
        names = (one.name for one in fields(MappingSettings) if one.name in cls.__dataclass_fields__)
        return cls(**{name: getattr(settings, name) for name in names if hasattr(settings, name)}, **more)

    @property
    def sample_radius_m(self) -> float:
        """Radius of the footprint that samples have in the map [m]; 0 if the map is of its mean."""
        return self.footprint_radius_m if self.fit == "reml" and self.deconvolve is not False else 0.0


_DEFAULTS = FieldMapSettings()


@dataclass(frozen=True, eq=False)
class MapState:
    """Input from which a map is computed; it never changes.

    :param stamp_s: end of the last record [s since 1970-01-01 UTC], 0 before the first
    :param fit_samples: the samples that the variogram is fitted to: as they were when it was last due
    :param search_samples: the samples by which its direction was found: as they were when that was last due;
        ``None`` for ``fit_samples``
    :param timed: the samples by place and time; ``None`` if no drift is looked for
    :param fit_timed: these and the samples, as they were when a drift was last due, and the time then [s]
    :param model_samples: with knowledge, the samples to which what earlier surveys determine too is fitted:
        as they were when that was last due; ``None`` for ``fit_samples``
    :param given_change: how the mean rate of ``timed`` changed, if that was found elsewhere: used instead, and
        ``timed`` as it is
    :param medians: of the pressure factor, the humidity factor, x and y of its records; NaN before the first
    """

    records: int = 0
    stamp_s: float = 0.0
    samples: Samples = NO_SAMPLES
    fit_samples: Samples = NO_SAMPLES
    search_samples: Samples | None = None
    given_fit: VariogramFit | None = None
    timed: TimedSamples | None = None
    fit_timed: tuple[TimedSamples, Samples, float] | None = None
    model_samples: Samples | None = None
    began_s: float = 0.0
    given_change: Change | None = None
    medians: tuple[float, ...] = (math.nan,) * 4

    @cached_property
    def without_footprint(self) -> MapState:
        """The state as if the sensor saw its own place only."""

        def without(one: _Some) -> _Some:
            return one if one is None else one.without_footprint

        fit_timed = self.fit_timed
        if fit_timed is not None:
            fit_timed = without(fit_timed[0]), without(fit_timed[1]), fit_timed[2]
        names = ("samples", "fit_samples", "search_samples", "timed", "model_samples")
        return replace(self, fit_timed=fit_timed, **{name: without(getattr(self, name)) for name in names})

    @cached_property
    def mapped_timed(self) -> TimedSamples | None:
        """``timed`` at the places of the samples, of which a map with a drift is made."""
        if self.timed is None or self.given_change is not None:
            return self.timed
        return self.timed.at(self.samples)

    def mapped_samples(self, soil_map: SoilMap | None) -> Samples:
        """The samples of which a map of this state is made; ``None`` for the samples before the first map."""
        whole = soil_map is None or soil_map.deconvolved_m
        return self.samples if whole else self.samples.without_footprint

    def changing(self, soil_map: SoilMap) -> Changing | None:
        """The drift that the map of this state allows for, and its samples; ``None`` without a drift."""
        state = self if soil_map.deconvolved_m else self.without_footprint
        if soil_map.change.drift is None or state.mapped_timed is None:
            return None
        return Changing(state.mapped_timed, soil_map.change, state.stamp_s)


@dataclass(frozen=True, eq=False)
class Snapshot:
    """All that a :class:`FieldMap` knows at one time; it does not change any more."""

    state: MapState
    track: tuple[CountRecord, ...]
    skipped: Mapping[Skip, SkippedRecords]


class FieldMap:
    """The map of a field that grows: records or samples go in, :meth:`compute` makes the map of any state.

    :meth:`add` is quick. :meth:`compute` may run in other threads; the map of a state is the same, bit for bit,
    whether or not those of earlier states were computed.

    :param knowledge: what is known of the field besides the counts of this survey

    >>> grid = FieldGrid.from_polygon([(0, 0), (60, 0), (60, 40), (0, 40)], cell_m=10.0)
    >>> field_map = FieldMap(grid)
    >>> for x_m, counts in [(5, 310), (25, 260), (55, 350)]:
    ...     field_map.add_sample((x_m, 20.0), counts, effective_exposure_s=100.0)
    >>> field_map.update()
    SoilMap(4 x 6 cells of 10 m, 3 samples, matern32)
    """

    def __init__(
        self, grid: FieldGrid, settings: FieldMapSettings = _DEFAULTS, knowledge: Knowledge = NOTHING
    ) -> None:
        if not (math.isfinite(settings.margin_m) and settings.margin_m >= 0):
            raise ValueError(f"margin_m must be >= 0 and finite, got {settings.margin_m}")
        self.grid, self.settings, self.knowledge = grid, settings, knowledge
        if settings.fit == "soft_l1" and self.farm is not None:
            raise InputError("a fit by soft_l1 has no prior", "leave the prior out, or fit by reml")
        chosen_m = settings.merge_radius_m
        # records closer together than this become one sample [m]
        self.merge_radius_m = default_merge_radius_m(grid, settings.margin_m) if chosen_m is None else chosen_m
        self._made: dict[str, tuple[object, Any]] = {}
        self._joint = None if knowledge.is_empty else JointModel(knowledge, self._estimate, settings.noise)
        self._finds_drift = settings.drift_model == "auto" and settings.fit == "reml"
        self.curve_of: Callable[[MapState], MoistureCurve | None] | None = None
        """Calibration that follows from the records of a state, instead of that of the settings."""
        self.reset()

    def __repr__(self) -> str:
        rows, columns = self.grid.shape
        size = f"{rows} x {columns} cells of {self.grid.cell_m:g} m"
        return f"FieldMap({size}, {self.state.records} records, {len(self.state.samples)} samples)"

    def reset(self) -> None:
        """Forget all records, samples and the last map."""
        self._merger = SampleMerger(self.merge_radius_m, self.settings.sample_radius_m)
        self._timed = SampleMerger(self.merge_radius_m, self.settings.sample_radius_m, WINDOW_S)
        self._paths = DrivenPaths()
        self._rising: tuple[list[float], ...] = ([], [], [], [])  # values of :data:`_MEDIANS`
        self._expected = ExpectedCounts(self.merge_radius_m)
        self._recent_fit: tuple[int, Variogram] | None = None
        self._recent: deque[Skip | None] = deque(maxlen=RECENT)
        self.state = MapState()
        self.soil_map: SoilMap | None = None  # of the last :meth:`update`
        self._mapped: MapState | None = None
        self.track: list[CountRecord] = []  # the records so far, those without a position included
        self.skipped: dict[Skip, SkippedRecords] = {}

    def add(self, record: CountRecord) -> Skip | None:
        """Add a record, merged into the sample around it.

        A record whose counts the map does not expect is quarantined until another one confirms it.
        """
        record = without_verdict(record)
        reason, why = check_record(record, self._area)
        if reason is not None:
            self.skip(reason, f"record at {_when(record.stamp_s)}: {why}")
            if reason in (Skip.NO_POSITION, Skip.QUARANTINED):
                self.track.append(record)
            return reason
        spread = self._paths.spread(record)
        verdict = self._expected.judge(record, (len(self.track), spread), self.state.samples, self._variogram)
        for held in verdict.confirmed:
            self._release(held)
        if verdict.unexpected:
            self.skip(Skip.UNEXPECTED, f"record at {_when(record.stamp_s)}: {verdict.unexpected}")
            self.track.append(replace(record, quarantine=UNEXPECTED))
            return Skip.UNEXPECTED
        self._recent.append(None)
        self.track.append(record)
        self._merge(record, spread)
        return None

    def _merge(self, record: CountRecord, spread: Array) -> None:
        self._merger.add_record(record, spread)
        for rising, value in zip(self._rising, _MEDIANS(record), strict=True):
            insort(rising, value)
        if self._finds_drift:
            self._timed.add_record(record, spread)
        timed, samples, earlier = self._timed_samples, self._merger.samples, self.state
        due = _has_grown(earlier.fit_samples, samples)
        search = earlier.search_samples
        if search is None or (due and _has_grown(search, samples, growth=SEARCH_GROWTH)):
            search = samples
        fit_timed = earlier.fit_timed
        if timed is not None and (
            due or fit_timed is None or _has_grown(fit_timed[0].samples, timed.samples, growth=CHANGE_GROWTH)
        ):
            fit_timed = timed, samples, record.stamp_s
        model, known = earlier.model_samples, 0 if self._joint is None else self._joint.fitted_samples
        if model is None or _has_grown(model, samples, known):
            model = samples
        fitted, began_s = samples if due else earlier.fit_samples, earlier.began_s or record.stamp_s
        state = MapState(earlier.records + 1, record.stamp_s, samples, fitted, search, began_s=began_s)
        medians = tuple(map(_middle, self._rising))
        self.state = replace(state, timed=timed, fit_timed=fit_timed, model_samples=model, medians=medians)

    @property
    def _timed_samples(self) -> TimedSamples | None:
        """The samples by place and time; ``None`` if no time matters."""
        return TimedSamples(self._timed.samples, self._timed.time_s) if self._finds_drift else None

    def _release(self, held: Held) -> None:
        """Use a record that was quarantined until another one confirmed it."""
        index, spread = held.where
        self.track[index] = held.record
        known = self.skipped.pop(Skip.UNEXPECTED)
        if known.count > 1:
            self.skipped[Skip.UNEXPECTED] = replace(known, count=known.count - 1)
        self._merge(held.record, spread)

    def _variogram(self) -> Variogram | None:
        """A recent variogram of the records so far; it does not depend on which maps were computed."""
        count = len(self.state.samples)
        if self._recent_fit is None or count > RECENT_GROWTH * self._recent_fit[0]:
            fit = self.fit(self.state)
            self._recent_fit = None if fit is None else (count, fit.variogram)
        return None if self._recent_fit is None else self._recent_fit[1]

    def add_sample(self, xy: tuple[float, float], raw_counts: float, effective_exposure_s: float) -> None:
        """Add a sample that is complete: it is not merged, and the variogram of the next map is fitted anew.

        :param xy: place [m]
        """
        self.set_samples(self.state.samples.joined(as_samples([xy], [raw_counts], [effective_exposure_s])))

    def set_records(self, records: Sequence[CountRecord]) -> None:
        """Replace all samples by those of a whole survey; its variogram is fitted to all of them.

        :param records: all with a place and an exposure > 0, in order of time; quarantined ones are left out, and
            so are those that :meth:`add` would quarantine
        """
        records = list(map(without_verdict, records))
        unexpected = self._unexpected(records)
        self.track = [unexpected.get(index, record) for index, record in enumerate(records)]
        records = [record for record in self.track if not record.quarantine]
        spreads = driven_spreads(records)
        samples = survey_samples(records, self.merge_radius_m, self.settings.sample_radius_m, spreads)
        began_s, end_s = (records[0].stamp_s, records[-1].stamp_s) if records else (0.0, 0.0)
        self._timed = SampleMerger(self.merge_radius_m, self.settings.sample_radius_m, WINDOW_S)
        timed = None
        if self._finds_drift and len(samples) <= MAX_EXACT_SAMPLES:
            self._timed.add_records(records, spreads)
            timed = self._timed_samples
        fit_timed = None if timed is None else (timed, samples, end_s)
        self.state = MapState(
            len(records), end_s, samples, samples, timed=timed, fit_timed=fit_timed, began_s=began_s
        )

    def _unexpected(self, records: Sequence[CountRecord]) -> dict[int, CountRecord]:
        """Records that :meth:`add` quarantines, by their index; they are counted as skipped."""
        # Larger samples are as good for this test, and quick for any number of records.
        radius_m = max(self.merge_radius_m, default_merge_radius_m(self.grid, self.settings.margin_m))
        grown = FieldMap(self.grid, replace(self.settings, merge_radius_m=radius_m, drift_model="off"))
        grown.farm = self.farm
        place = {}
        for index, record in enumerate(records):
            if not record.quarantine:
                place[len(grown.track)] = index
                grown.add(record)
        found = {place[at]: record for at, record in enumerate(grown.track) if record.quarantine == UNEXPECTED}
        if found:
            self.skipped[Skip.UNEXPECTED] = grown.skipped[Skip.UNEXPECTED]
        return found

    def set_samples(
        self, samples: Samples, fit: VariogramFit | None = None, changing: Changing | None = None
    ) -> None:
        """Replace all samples by some that were merged elsewhere.

        :param changing: with it, the samples by place and time and their drift, if one was found
        """
        earlier = self.state
        self.state = MapState(
            earlier.records,
            earlier.stamp_s if changing is None else changing.now_s,
            samples,
            samples,
            given_fit=fit,
            timed=None if changing is None else changing.timed,
            began_s=earlier.began_s,
            given_change=None if changing is None else changing.change,
        )

    def skip(self, reason: Skip, why: str) -> None:
        """Count a record that cannot be used."""
        self._recent.append(reason)
        earlier = self.skipped.get(reason)
        self.skipped[reason] = SkippedRecords(1 if earlier is None else earlier.count + 1, why)

    def snapshot(self) -> Snapshot:
        """All that is known now."""
        return Snapshot(self.state, tuple(self.track), dict(self.skipped))

    @property
    def trouble(self) -> Skip | None:
        """Reason why most of the last records were left out, ``None`` if most were not."""
        skipped = [reason for reason in self._recent if reason is not None]
        return max(skipped, key=skipped.count) if 2 * len(skipped) > len(self._recent) else None

    @property
    def samples(self) -> Samples:
        """The samples so far; those behind the last map may be fewer."""
        return self.state.samples

    @property
    def kriging(self) -> PoissonKriging | None:
        """The kriging of the last map; ``None`` before the first map."""
        return None if self.soil_map is None else self.soil_map.kriging

    @property
    def changing(self) -> Changing | None:
        """The drift of the last map, and its samples by place and time; ``None`` without a drift."""
        if self.soil_map is None or self._mapped is None:
            return None
        return self._mapped.changing(self.soil_map)

    @property
    def rate(self) -> Array:
        """Rate of the last map in the cells inside, shape (g,) [counts/s]; NaN before the first map."""
        return self._inside(None if self.soil_map is None else self.soil_map.rate)

    @property
    def variance(self) -> Array:
        """Kriging variance of the last map in the cells inside, shape (g,) [(counts/s)^2]; NaN before any map."""
        return self._inside(None if self.soil_map is None else self.soil_map.variance)

    def _inside(self, raster: Array | None) -> Array:
        mask = self.grid.mask
        return np.full(np.count_nonzero(mask), np.nan) if raster is None else raster[mask]

    def update(self, state: MapState | None = None) -> SoilMap | None:
        """Compute the map of the state now, and keep it as :attr:`soil_map`.

        :returns: the map; ``None`` while there are too few samples, then the last map stays as it was
        :raises IllConditionedError: as :meth:`compute`; the last map stays as it was
        """
        state = self.state if state is None else state
        if state is self._mapped:
            return self.soil_map
        soil_map = self.compute(state)
        if soil_map is not None:
            self.soil_map, self._mapped = soil_map, state
        return soil_map

    def compute(
        self, state: MapState, progress: Progress | None = None, grid: FieldGrid | None = None
    ) -> SoilMap | None:
        """The map of a state, ``None`` while its samples are too few: one place for REML, two for soft-L1.

        It depends on nothing but the state and the settings.

        :raises IllConditionedError: if the samples and the variogram contradict each other numerically
        """
        state = self._as_seen(state)
        fit, settings = self.fit(state), self.settings
        if fit is None:
            return None
        change = self._change(state, fit)
        timed = None if change == NO_CHANGE else state.mapped_timed
        changing = None if timed is None else Changing(timed, change, state.stamp_s)
        return make_soil_map(
            state.samples,
            self.grid if grid is None else grid,
            fit,
            settings.curve if self.curve_of is None else self.curve_of(state),
            settings.keep_nugget,
            progress,
            changing,
            settings.footprint_radius_m,
        )

    def fit(self, state: MapState) -> VariogramFit | None:
        """The variogram of a state, ``None`` while its samples are too few."""
        if not len(state.samples):
            return None
        state = self._as_seen(state)
        if state.given_fit is not None:
            given = state.given_fit  # with what is known of the field, unless it has that already
            if self._joint is None or given.prior is not None:
                return given
            return self._joint.fit(state.samples, state.samples, state.began_s, given)
        samples = state.fit_samples
        if self.settings.fit == "soft_l1" and not (samples.xy != samples.xy[:1]).any():
            return None
        return self._once("fit", samples, lambda: self._fitted(state))

    def _fitted(self, state: MapState) -> VariogramFit:
        samples, joint = state.fit_samples, self._joint
        if joint is not None and self.knowledge.earlier:
            return joint.fit(samples, state.model_samples or samples, state.began_s)
        search = state.search_samples or samples
        alone = self._once("search", search, lambda: self._estimate(search))
        if search is not samples:
            alone = self._estimate(samples, like=alone)
        return alone if joint is None else joint.fit(samples, samples, state.began_s, alone=alone)

    def _once(self, what: str, key: object, make: Callable[[], _Made]) -> _Made:
        """Cached result of this very key, if the key is the last one; otherwise the newly made result."""
        known = self._made.get(what)
        if known is None or known[0] is not key:
            known = self._made[what] = key, make()
        return cast(_Made, known[1])

    def _as_seen(self, state: MapState) -> MapState:
        """The state without the footprint, if the counts object to it."""
        weighed = state.search_samples or state.fit_samples
        known = self.settings.deconvolve is not None or state.given_fit is not None or self.knowledge.earlier
        if known or not weighed.spread[:, 3].any():
            return state
        model, extent_m = self.settings.model, self.grid.extent_m
        fits = self._once("footprint", weighed, lambda: fits_footprint(weighed, model, extent_m))
        return state if fits else state.without_footprint

    @cached_property
    def expected_fit(self) -> VariogramFit | None:
        """Variogram and prior before the first sample, from earlier surveys; ``None`` without any.

        Its mean rate is that of the earlier surveys: the mean of this survey is not known.
        """
        return None if self._joint is None else self._joint.expected()

    def _estimate(
        self,
        samples: Samples,
        others: Sequence[Samples] = (),
        effects: Sequence[Array] | None = None,
        like: VariogramFit | None = None,
    ) -> VariogramFit:
        """The variogram of samples and of other surveys, see :func:`estimate_variogram`."""
        farm = self.farm and self.farm.besides(self.state.began_s)
        fit = estimate_variogram(
            samples.xy,
            samples.counts,
            samples.exposure_s,
            self.settings.model,
            self.settings.fit,
            extent_m=self.grid.extent_m,
            spread=samples.spread,
            local_noise=self.settings.noise == "local",
            others=others,
            effects=effects,
            like=like,
            farm=farm,
        )
        if farm is None and self.farm is not None:
            return replace(fit, other_fields="not used: the only survey is this one")
        return fit

    @cached_property
    def farm(self) -> FarmPrior | None:
        """Surveys of other fields that inform the variogram; ``None`` without any."""
        return FarmPrior.named(self.settings.prior)

    def _change(self, state: MapState, fit: VariogramFit) -> Change:
        """Change of the mean rate up to a state, as far as it is known."""
        if state.given_change is not None:
            return state.given_change
        if state.fit_timed is None or len(state.samples) > MAX_EXACT_SAMPLES:
            return NO_CHANGE
        timed, samples, now_s = state.fit_timed

        model = fit.variogram, fit.noise_rate, fit.prior
        return self._once("change", timed, lambda: find_change(timed, now_s, *model, samples))

    @cached_property
    def _area(self) -> Polygon | MultiPolygon:
        """The field and its margin: where records count."""
        import shapely

        area = shapely.Polygon(self.grid.polygon).buffer(self.settings.margin_m)
        shapely.prepare(area)
        return area


def fits_footprint(samples: Samples, model: ModelName, extent_m: float) -> bool:
    """True if the counts do not object to the footprint of their samples.

    They object if neighbours differ more than means over the footprint can: the restricted likelihood is then
    higher without it, by the factor 7 at least. Few counts never object.
    """
    some = samples.some(slice(None, None, max(1, -(-len(samples) // _WEIGHED_PLACES))))
    columns = some.xy, some.counts, some.exposure_s, model

    def likelihood(spread: Array) -> float:
        return estimate_variogram(*columns, extent_m=extent_m, spread=spread, anisotropy=False).objective

    without = likelihood(some.without_footprint.spread)
    return likelihood(some.spread) > without - OBJECTION


def default_merge_radius_m(grid: FieldGrid, footprint_radius_m: float) -> float:
    """Radius within which records become one sample [m]: a quarter of the footprint, on large fields more.

    There a fortieth of the extent keeps the samples of a day's drive to some hundreds.
    """
    return max(footprint_radius_m / 4, grid.extent_m / 40)


def _when(stamp_s: float) -> str:
    """Time of a record, for people: a time of day, unless it is simulated or none [s since 1970 UTC]."""
    real = 1e8 < stamp_s < 1e11
    return f"{datetime.fromtimestamp(stamp_s, UTC):%H:%M:%S} UTC" if real else f"{stamp_s:.1f} s"


def _middle(rising: Sequence[float]) -> float:
    """Median of values in order."""
    return (rising[(len(rising) - 1) // 2] + rising[len(rising) // 2]) / 2


def _has_grown(fitted: Samples, samples: Samples, earlier: int = 0, growth: float | None = None) -> bool:
    """True if a new fit is due. It depends on the records alone, not on which maps were computed."""
    if growth is None:
        growth = LATER_REFIT_GROWTH if len(fitted) + earlier >= MANY_SAMPLES else REFIT_GROWTH
    factor = 1 + growth
    before, now = fitted.exposure_s.sum(), samples.exposure_s.sum()
    if earlier:
        before += earlier * before / len(fitted)
        now += earlier * now / len(samples)
    return len(samples) + earlier > factor * (len(fitted) + earlier) or bool(now > factor * before)
