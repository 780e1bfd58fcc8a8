# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Dwell rules: how long to count at a stop.

A rule sees only the counts of the stop. With the rule ``optimal`` a strategy plans the dwell of each stop.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from fractions import Fraction
from functools import cached_property
from typing import Annotated, Any, Protocol

from pydantic import PlainSerializer, PlainValidator

from soilmoist_ros.foundation import InputError, Registry

MAX_DWELL_S = 3600.0
"""Default of the longest dwell [s]; it limits the time that the robot waits for a dead or drowned sensor."""

MIN_INTERVAL_S, MAX_INTERVAL_S = 1, 86400
FINEST_THRESHOLD, COARSEST_THRESHOLD = Decimal("0.001"), Decimal("0.5")

_EXAMPLES = (
    "write for example 'fmi:600' (600 s), 'ami:0.025' or 'ami:2.5%' (standard error of the count), or 'optimal'"
)
_ROUNDING = 1e-9  # relative rounding error allowed in sums of exposures


class DwellRule(Protocol):
    """Decides when a dwell ends. :func:`parse_dwell` reads ``str(rule)``."""

    @property
    def longest_s(self) -> float:
        """Time at the stop after which counting ends, regardless of the counts [s]."""

    def enough(self, raw_counts: int, live_s: float) -> bool:
        """True if counting may end, by the raw counts at the stop and their exposure [s]."""

    def expected_s(self, rate_cps: float, factor: float = 1.0) -> float:
        """Expected dwell, for planning [s]; ``longest_s`` where the rate is unknown (NaN) or not positive.

        :param rate_cps: corrected rate expected at the stop [counts/s]
        :param factor: product of the correction factors, ``raw rate = rate / factor`` [-]
        """

    def progress(self, raw_counts: int, live_s: float) -> float:
        """Share of the dwell that is done, 0..1; 1 exactly if :meth:`enough`."""

    def outcome(self, raw_counts: int, live_s: float) -> str:
        """Result of the dwell in words, after counting has ended."""


def _read_rule(value: object) -> DwellRule | None:
    """Read a rule from text; a rule is returned unchanged, an empty text gives ``None``.

    Earlier versions weighed each stop with ``optimal`` against the others, and wrote ``value:NUMBERS`` for it.
    """
    if isinstance(value, str) and value.startswith("value:"):
        return Optimal()
    return parse_dwell(value) if isinstance(value, str) and value else value or None  # type: ignore[return-value]


StopRule = Annotated[
    DwellRule | None,
    PlainValidator(_read_rule),
    PlainSerializer(lambda rule: "" if rule is None else str(rule), return_type=str),
]
"""Dwell rule of a single stop, ``None`` for the mission's rule. Journals contain it as text."""


@dataclass(frozen=True)
class FixedInterval:
    """Count for a fixed time ("FMI").

    :param longest_s: longest time at the stop [s]. :func:`parse_dwell` sets at least twice the interval,
        so that only a sensor with little live time reaches the limit.
    """

    interval_s: float  # time to count [s], > 0
    longest_s: float = MAX_DWELL_S

    def enough(self, raw_counts: int, live_s: float) -> bool:
        """See :class:`DwellRule`."""
        return live_s >= self.interval_s * (1 - _ROUNDING)

    def expected_s(self, rate_cps: float, factor: float = 1.0) -> float:
        """See :class:`DwellRule`."""
        return self.interval_s

    def progress(self, raw_counts: int, live_s: float) -> float:
        """See :class:`DwellRule`."""
        return 1.0 if self.enough(raw_counts, live_s) else live_s / self.interval_s

    def outcome(self, raw_counts: int, live_s: float) -> str:
        """See :class:`DwellRule`."""
        return f"{raw_counts} counts in {live_s:.0f} of {_plain(self.interval_s)} s"

    def __str__(self) -> str:
        return f"fmi:{_plain(self.interval_s)}"


@dataclass(frozen=True)
class AdaptiveInterval:
    """Count until the relative standard error ``1 / sqrt(raw counts)`` falls to a threshold ("AMI").

    The rule uses the *raw* counts: they are Poisson distributed, corrected counts are not.
    """

    threshold: float  # relative standard error to reach, 0 < threshold < 1 [-]
    longest_s: float = MAX_DWELL_S  # counting ends after this time in any case [s]

    @cached_property
    def counts_needed(self) -> int:
        """Smallest count that meets the threshold: 1600 for 0.025, 1112 for 0.03.

        Computed from the decimal number as written: in floating point ``1 / 0.025**2`` is not 1600.
        """
        return math.ceil(1 / Fraction(repr(float(self.threshold))) ** 2)

    def enough(self, raw_counts: int, live_s: float) -> bool:
        """See :class:`DwellRule`."""
        return raw_counts >= self.counts_needed or live_s >= self.longest_s * (1 - _ROUNDING)

    def expected_s(self, rate_cps: float, factor: float = 1.0) -> float:
        """See :class:`DwellRule`."""
        if not (rate_cps > 0 and factor > 0):
            return self.longest_s
        return min(self.counts_needed * factor / rate_cps, self.longest_s)

    def progress(self, raw_counts: int, live_s: float) -> float:
        """See :class:`DwellRule`."""
        if self.enough(raw_counts, live_s):
            return 1.0
        return max(raw_counts / self.counts_needed, live_s / self.longest_s)

    def outcome(self, raw_counts: int, live_s: float) -> str:
        """See :class:`DwellRule`."""
        error = f"{100 / math.sqrt(raw_counts):.2g} %" if raw_counts > 0 else "no standard error"
        text = f"{raw_counts} counts ({error}) in {live_s:.0f} s"
        if raw_counts < self.counts_needed:
            text += f"; {100 * self.threshold:.3g} % would need {self.counts_needed} counts"
        return text

    def __str__(self) -> str:
        return f"ami:{_plain(self.threshold)}"


@dataclass(frozen=True)
class Optimal(FixedInterval):
    """Count as long as the strategy plans for each stop, or for a fixed time where it plans none.

    The published strategies plan none. To count there until a further second was worth more elsewhere made no
    better maps with ``greedy`` and ``monte_carlo`` (error with 60 s over that on three fields, six seeds: 0.92 to
    1.03), and 6 to 15 % better ones with ``adaptive_sampling``, which drove 1.7 times as far.
    """

    interval_s: float = 60.0  # dwell that is not planned [s]

    def outcome(self, raw_counts: int, live_s: float) -> str:
        """See :class:`DwellRule`."""
        return f"{raw_counts} counts in {live_s:.0f} s, the dwell where none is planned"

    def __str__(self) -> str:
        return "optimal"


def parse_dwell(text: str, longest_s: float = MAX_DWELL_S) -> DwellRule:
    """Read a dwell rule; ``str`` of the result is its simplest form, which reads as an equal rule.

    :param text: ``fmi:SECONDS``, ``ami:THRESHOLD``, ``ami:PERCENT%`` or ``optimal``; upper case and spaces do
        not matter
    :param longest_s: counting by ``ami`` or ``optimal`` ends after this time in any case [s], > 0
    :raises InputError: if the text is not a rule; the message lists examples
    """
    if not (math.isfinite(longest_s) and longest_s > 0):
        raise InputError(
            f"the longest dwell of {longest_s} s is not positive and finite", "give seconds, e.g. 3600"
        )
    name, colon, number = (part.strip() for part in text.lower().partition(":"))
    if name.removesuffix("s").isdecimal():
        raise InputError(f"the dwell rule {text.strip()!r} is a number without a rule", _EXAMPLES)
    kind = DWELL_RULES.get(name)
    if kind.needs_value and not number:
        raise InputError(f"the dwell rule {text.strip()!r} has no number after '{name}:'", _EXAMPLES)
    if colon and not kind.needs_value:
        raise InputError(f"the dwell rule {text.strip()!r} must be '{name}' alone", _EXAMPLES)
    rule = kind.read(number, longest_s)
    if not callable(getattr(rule, "enough", None)):
        what = f"read must return a DwellRule; it returned {type(rule).__name__}"
        raise InputError(f"dwell rule {name!r}: {what}", "correct the plug-in")
    return rule


def dwell_rule(given: str | DwellRule, longest_s: float = MAX_DWELL_S) -> DwellRule:
    """Read a dwell rule if it is text; see :func:`parse_dwell`."""
    return parse_dwell(given, longest_s) if isinstance(given, str) else given


@dataclass(frozen=True)
class DwellKind:
    """A dwell rule that users choose by name.

    :param read: makes the rule from the text after ``NAME:`` and the longest dwell [s];
        raises :class:`InputError` if the text is no value
    """

    read: Callable[[str, float], DwellRule]
    describe: Callable[[str], str]  # returns a readable description for the text after ``NAME:``
    needs_value: bool = True  # whether the rule requires this text; otherwise the rule is its name alone
    about: str = ""  # what it does, for people in the field
    example: str = ""  # how it is written; empty for the name alone


def _fixed(number: str, longest_s: float) -> DwellRule:
    seconds = _decimal(number, "fmi")
    if not MIN_INTERVAL_S <= seconds <= MAX_INTERVAL_S:
        raise InputError(
            f"'fmi:{number}' is not between {MIN_INTERVAL_S} and {MAX_INTERVAL_S} s",
            "give the seconds to count at each stop, for example 'fmi:600'",
        )
    interval_s = float(seconds)
    return FixedInterval(interval_s, max(longest_s, 2 * interval_s))


def _adaptive(number: str, longest_s: float) -> DwellRule:
    percent = number.endswith("%")
    threshold = _decimal(number.removesuffix("%").strip(), "ami")
    if percent:
        threshold /= 100
    if not FINEST_THRESHOLD <= threshold <= COARSEST_THRESHOLD:
        meant_percent = not percent and FINEST_THRESHOLD <= threshold / 100 <= COARSEST_THRESHOLD
        raise InputError(
            f"the threshold of 'ami:{number}' is not between {FINEST_THRESHOLD} and {COARSEST_THRESHOLD}",
            f"did you mean 'ami:{number}%'?" if meant_percent else "it is 1/sqrt(counts), for example 'ami:0.025'",
        )
    return AdaptiveInterval(float(threshold), longest_s)


def _checked(plug_in: Any) -> DwellKind:
    """Check a dwell rule of another package; raises TypeError."""
    if not isinstance(plug_in, DwellKind):
        raise TypeError(f"a dwell rule must be a DwellKind, got {type(plug_in).__name__}")
    return plug_in


DWELL_RULES: Registry[DwellKind] = Registry(
    "soilmoist_ros.dwell_rules",
    "dwell rule",
    {
        "fmi": DwellKind(
            _fixed,
            lambda number: f"FMI {float(number):g} s",
            True,
            "Counts for a fixed time, in seconds.",
            "fmi:600",
        ),
        "ami": DwellKind(
            _adaptive,
            lambda number: f"AMI {100 * float(number):g} %",
            True,
            "Counts until the relative standard error of the count falls to a threshold.",
            "ami:3%",
        ),
        "optimal": DwellKind(
            lambda _, longest_s: Optimal(min(Optimal.interval_s, longest_s), longest_s),
            lambda _: "Optimal",
            False,
            "Counts at each stop as long as the strategy plans, or 60 s.",
        ),
    },
    _checked,
)
"""Dwell rules by name; other packages add rules with the entry point ``soilmoist_ros.dwell_rules``."""


def _decimal(number: str, rule: str) -> Decimal:
    try:
        value = Decimal(number)
        if value.is_finite():
            return value
    except InvalidOperation:
        pass
    raise InputError(f"{number!r} in '{rule}:{number}' is not a finite number", _EXAMPLES)


def _plain(value: float) -> str:
    return repr(int(value)) if float(value).is_integer() else repr(float(value))
