"""Plan requests wait here until the map has what was just measured; then they are answered."""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass

from soilmoist_ros.exploration.control.explorer import Explorer
from soilmoist_ros.exploration.control.team import PendingMeasurement
from soilmoist_ros.exploration.mission.types import PlanFailed, PlanKind, Planned, RequestPlan
from soilmoist_ros.exploration.planning.properties import Property
from soilmoist_ros.foundation.errors import SoilmoistError
from soilmoist_ros.mapping.field_map import FieldMap, FieldMapSettings
from soilmoist_ros.mapping.grid import FieldGrid
from soilmoist_ros.mapping.samples.samples import Samples
from soilmoist_ros.mapping.variogram.fit import VariogramFit

SAME_TIME_S = 1e-3
"""Times that differ by less are the same: they have been through messages [s]."""
BESIDE_S = 10.0
"""The last record of another sensor at a stop may have ended so much earlier [s]."""

_log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class PlanJob:
    """A request that can be answered now.

    :param request: what the mission asks for
    :param place: where the robot is [m]
    :param samples: merged samples, ``None`` if none have come
    :param fit: their variogram, ``None`` if none has come
    :param late: whether the map lacks what was measured last, because it did not come in time
    :param others: what other robots on the field are about
    :param beside: map of each further property that has one: samples, variogram, weight
    """

    request: RequestPlan
    place: tuple[float, float]
    samples: Samples | None
    fit: VariogramFit | None
    late: bool
    others: tuple[PendingMeasurement, ...] = ()
    beside: tuple[tuple[Samples, VariogramFit, float], ...] = ()


@dataclass
class _Held:
    """The newest map of a further property.

    :param weight: what a share of its variation is worth, that of the first being 1
    :param samples: merged samples, with the time of the last record in them [s]
    :param fit: their variogram, with the time of the last record in it [s]
    :param late: whether it was waited for in vain, and nothing has come since
    """

    weight: float
    samples: tuple[Samples, float] | None = None
    fit: tuple[VariogramFit, float] | None = None
    late: bool = False


class PlanningQueue:
    """Holds the newest plan request and the newest maps.

    :param wait_s: longest time to wait for the map [s]
    """

    def __init__(self, wait_s: float) -> None:
        self._wait_s = wait_s
        self._open: tuple[RequestPlan, float] | None = None
        self._measured_s = -math.inf
        self._samples: tuple[Samples, float] | None = None
        self._fit: tuple[VariogramFit, float] | None = None
        self._others: dict[str, PendingMeasurement] = {}
        self._beside: dict[str, _Held] = {}
        self.weighed: tuple[str, ...] = ()
        """Further properties whose maps the last plan takes into account."""

    @property
    def map_s(self) -> float:
        """Time of the last record in the map [s]; -inf without one."""
        return min(held[1] if held is not None else -math.inf for held in (self._samples, self._fit))

    def measured(self, stamp_s: float) -> None:
        """A stop is complete; its last record ended then [s]."""
        self._measured_s = stamp_s

    def ask(self, request: RequestPlan, now_s: float) -> None:
        """A plan is wanted; one that was wanted before is not any more."""
        self._open = (request, now_s)

    def take_samples(self, samples: Samples, stamp_s: float) -> None:
        """Samples have come, with the time of the last record in them [s]."""
        self._samples = (samples, stamp_s)

    def take_fit(self, fit: VariogramFit | None, stamp_s: float) -> None:
        """A variogram has come, with the time of the last record in it [s]; ``None``: there is none now."""
        self._fit = None if fit is None else (fit, stamp_s)

    def expect_property(self, name: str, weight: float) -> None:
        """A further property is mapped beside; stops are chosen without its map until that comes."""
        self._beside[name] = _Held(weight)

    def take_samples_of(self, name: str, samples: Samples, stamp_s: float) -> None:
        """As :meth:`take_samples`, of a further property."""
        held = self._beside[name]
        held.samples, held.late = (samples, stamp_s), False

    def take_fit_of(self, name: str, fit: VariogramFit | None, stamp_s: float) -> None:
        """As :meth:`take_fit`, of a further property."""
        held = self._beside[name]
        held.fit, held.late = (None if fit is None else (fit, stamp_s)), False

    @property
    def faults_beside(self) -> tuple[str, ...]:
        """What is wrong with the maps of further properties, in words."""
        named = self._beside.items()
        missing = [name for name, held in named if held.samples is None or held.fit is None]
        late = [name for name, held in named if name not in missing and held.late]
        return (
            *([f"no map has come of {', '.join(missing)}: stops are chosen without it"] if missing else []),
            *([f"the map of {', '.join(late)} does not follow: stops are chosen with an old one"] if late else []),
        )

    def take_other(self, name: str, pending: PendingMeasurement | None) -> None:
        """Another robot has told what it is about, ``None`` for nothing."""
        self._others.pop(name, None)
        if pending is not None:
            self._others[name] = pending

    def due(self, now_s: float, place: tuple[float, float] | None) -> PlanJob | None:
        """The request, once, when it can be answered: the map is up to date, or does not come in time."""
        if self._open is None or place is None:
            return None
        request, since_s = self._open
        lacking, behind = self._lacking(request.kind), self._behind()
        if (lacking or (behind and request.kind is PlanKind.EXPLORE)) and now_s - since_s < self._wait_s:
            return None
        self._open = None
        for held in behind:
            held.late = True
        mapped = {
            name: (held.samples[0], held.fit[0], held.weight)
            for name, held in self._beside.items()
            if held.samples is not None and held.fit is not None
        }
        self.weighed = tuple(name for name, (_, _, weight) in mapped.items() if weight > 0)
        samples = self._samples[0] if self._samples is not None else None
        fit = self._fit[0] if self._fit is not None else None
        return PlanJob(request, place, samples, fit, lacking, tuple(self._others.values()), (*mapped.values(),))

    def _lacking(self, kind: PlanKind) -> bool:
        """Whether what was measured is not yet in the map; before the first measurement nothing can be."""
        if math.isinf(self._measured_s):
            return False
        held = (self._samples,) if kind is PlanKind.WARM_UP else (self._samples, self._fit)
        return any(item is None or item[1] < self._measured_s - SAME_TIME_S for item in held)

    def _behind(self) -> list[_Held]:
        """Maps of further properties that lack what was measured, and are worth waiting for."""
        since_s = self._measured_s - BESIDE_S
        return [
            held
            for held in self._beside.values()
            if held.samples is not None and held.fit is not None and not held.late
            if min(held.samples[1], held.fit[1]) < since_s
        ]


def answer(explorer: Explorer, job: PlanJob, needs_map: bool) -> Planned | PlanFailed:
    """Answer a request. Takes a while, and never fails: what goes wrong becomes a :class:`PlanFailed`.

    :param explorer: chooses; its map is brought up to date
    :param job: the request
    :param needs_map: whether the strategy cannot do without a map
    :returns: the answer; its time is 0, to be set when it is handed on
    """
    plan_id = job.request.plan_id
    field_map = explorer.field_map
    try:
        if job.samples is not None and len(job.samples):
            if job.fit is not None:
                field_map.set_samples(job.samples, job.fit)
                field_map.update()
            else:
                field_map.set_samples(job.samples)
        explorer.properties = tuple(
            Property(_mapped(field_map.grid, samples, fit), weight)
            for samples, fit, weight in job.beside
            if weight > 0 and len(samples)
        )
        if needs_map and job.request.kind is PlanKind.EXPLORE and field_map.soil_map is None:
            return PlanFailed(0.0, plan_id, "no map has come: is the mapper running?")
        plan = explorer.plan(job.request, job.place, job.others)
    except (SoilmoistError, ValueError, ArithmeticError) as error:
        return PlanFailed(0.0, plan_id, str(error))
    except Exception as error:  # a mistake of ours: the mission asks the operator in the end
        _log.exception("planning failed")
        return PlanFailed(0.0, plan_id, f"{type(error).__name__}: {error}")
    reason = "" if plan.choice is not None else "no stop that is left fits into the time"
    return Planned(0.0, plan_id, plan.choice, plan.travel_s, reason)


def _mapped(grid: FieldGrid, samples: Samples, fit: VariogramFit) -> FieldMap:
    found = FieldMap(grid, FieldMapSettings(for_planning=True))
    found.set_samples(samples, fit)
    found.update()
    return found
