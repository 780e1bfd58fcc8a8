# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Dwell rules: how long to count at a stop.

A rule sees only the counts of the stop. :class:`MarginalValue` compares the gain of a longer dwell with the
price of time. It is made anew for each stop and contains the kriging quantities of the stop.
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
_HALVINGS = 50


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
    """Read a rule from text; a rule is returned unchanged, an empty text gives ``None``."""
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
    """Count as long as it pays: :class:`MarginalValue` at each stop, or a fixed dwell while there is no map."""

    interval_s: float = 60.0  # dwell without a map [s]

    def outcome(self, raw_counts: int, live_s: float) -> str:
        """See :class:`DwellRule`."""
        return f"{raw_counts} counts in {live_s:.0f} s, the dwell without a map"

    def __str__(self) -> str:
        return "optimal"


@dataclass(frozen=True)
class MarginalValue:
    """Count at a stop while one more second there lowers the integrated variance more than a second elsewhere.

    A dwell of t seconds lowers the integrated variance by ``A t / (B t + n)``, with n the rate times the
    correction factor. Counting pays while ``A n / (B t + n)^2 > price``. The rate is the rate counted at the stop.
    Every further property adds a term, with its expected noise.
    """

    gain: float  # A: weighted sum over the cells of the squared posterior covariance with the stop
    variance: float  # B: posterior variance at the stop, nugget included [(counts/s)^2], > 0
    price: float  # reduction of the integrated variance per second elsewhere, >= 0
    factor: float = 1.0  # product of the correction factors, ``raw rate = rate / factor`` [-]
    longest_s: float = MAX_DWELL_S  # counting ends after this time in any case [s]
    others: tuple[tuple[float, float, float], ...] = ()  # A, B and n of each further property

    def enough(self, raw_counts: int, live_s: float) -> bool:
        """See :class:`DwellRule`."""
        return live_s >= self._best_s(self._noise(raw_counts, live_s)) * (1 - _ROUNDING)

    def expected_s(self, rate_cps: float, factor: float = 1.0) -> float:
        """See :class:`DwellRule`."""
        # n is the square of the stop's own factor times the raw rate.
        return self._best_s(self.factor**2 * rate_cps / factor) if rate_cps > 0 else self.longest_s

    def progress(self, raw_counts: int, live_s: float) -> float:
        """See :class:`DwellRule`."""
        if self.enough(raw_counts, live_s):
            return 1.0
        return live_s / self._best_s(self._noise(raw_counts, live_s))

    def outcome(self, raw_counts: int, live_s: float) -> str:
        """See :class:`DwellRule`."""
        if live_s >= self.longest_s * (1 - _ROUNDING):
            return f"{raw_counts} counts in the longest dwell of {live_s:.0f} s"
        return f"{raw_counts} counts in {live_s:.0f} s; counting elsewhere is worth more now"

    def _noise(self, raw_counts: int, live_s: float) -> float:
        """Noise n at the counted rate; zero counts are replaced by half a count."""
        return self.factor**2 * max(raw_counts, 0.5) / live_s if live_s > 0 else math.inf

    def _best_s(self, noise: float) -> float:
        """Dwell after which the marginal value has fallen to the price [s]."""
        if not math.isfinite(noise):
            return self.longest_s
        terms = ((self.gain, self.variance, noise), *self.others)
        if self.price <= 0:
            return self.longest_s if any(gain > 0 for gain, _, _ in terms) else 0.0
        # The sum falls with time and reaches the price no sooner than any single term.
        alone_s = max((math.sqrt(gain * n / self.price) - n) / variance for gain, variance, n in terms)
        low, high = min(max(alone_s, 0.0), self.longest_s), self.longest_s
        for _ in range(_HALVINGS if self.others else 0):
            middle = (low + high) / 2
            marginal = sum(gain * n / (variance * middle + n) ** 2 for gain, variance, n in terms)
            low, high = (middle, high) if marginal > self.price else (low, middle)
        return low

    def __str__(self) -> str:
        others = "".join(f";{gain!r},{variance!r},{noise!r}" for gain, variance, noise in self.others)
        own = f"{self.gain!r},{self.variance!r},{self.price!r},{self.factor!r}"
        limit = "" if self.longest_s == MAX_DWELL_S else f"/{_plain(self.longest_s)}"
        return f"value:{own}{others}{limit}"


def parse_dwell(text: str, longest_s: float = MAX_DWELL_S) -> DwellRule:
    """Read a dwell rule; ``str`` of the result is its simplest form, which reads as an equal rule.

    :param text: ``fmi:SECONDS``, ``ami:THRESHOLD``, ``ami:PERCENT%`` or ``optimal``; upper case and spaces do
        not matter. Journals contain ``optimal`` at a stop as ``value:A,B,PRICE,FACTOR``, with ``;A,B,N`` for each
        further property and ``/LONGEST`` at the end.
    :param longest_s: counting by ``ami`` or ``optimal`` ends after this time in any case [s], > 0
    :raises InputError: if the text is not a rule; the message lists examples
    """
    if not (math.isfinite(longest_s) and longest_s > 0):
        raise InputError(
            f"the longest dwell of {longest_s} s is not positive and finite", "give seconds, e.g. 3600"
        )
    name, colon, number = (part.strip() for part in text.lower().partition(":"))
    if name == _OF_STOP:
        return _of_stop(number, longest_s)
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


def _of_stop(numbers: str, longest_s: float) -> DwellRule:
    terms, _, longest = numbers.partition("/")
    own, *more = terms.split(";")
    try:
        gain, variance, price, factor = map(float, own.split(","))
        others = tuple((a, b, n) for a, b, n in (map(float, other.split(",")) for other in more))
        longest_s = float(longest or longest_s)
        positive = [variance, factor, longest_s, *(value for _, b, n in others for value in (b, n))]
        not_negative = [gain, price, *(a for a, _, _ in others)]
        if min(positive) <= 0 or min(not_negative) < 0 or not all(map(math.isfinite, positive + not_negative)):
            raise ValueError
    except ValueError:
        form = "A,B,PRICE,FACTOR with ;A,B,N and /LONGEST, all in range"
        raise InputError(f"'value:{numbers}' is not {form}", _EXAMPLES) from None
    return MarginalValue(gain, variance, price, factor, longest_s, others)


def _checked(plug_in: Any) -> DwellKind:
    """Check a dwell rule of another package; raises TypeError."""
    if not isinstance(plug_in, DwellKind):
        raise TypeError(f"a dwell rule must be a DwellKind, got {type(plug_in).__name__}")
    return plug_in


_OF_STOP = "value"
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
            "Counts as long as counting here is worth more than driving on.",
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
