# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from soilmoist_ros.exploration import DWELL_RULES, Optimal, parse_dwell
from soilmoist_ros.exploration.planning.dwell import MAX_DWELL_S, AdaptiveInterval, DwellKind, FixedInterval
from soilmoist_ros.foundation.errors import InputError


@pytest.mark.parametrize(
    ("text", "rule", "plain"),
    [
        ("fmi:600", FixedInterval(600.0), "fmi:600"),
        ("fmi:12.5", FixedInterval(12.5), "fmi:12.5"),
        ("ami:0.025", AdaptiveInterval(0.025), "ami:0.025"),
        ("ami:2.5%", AdaptiveInterval(0.025), "ami:0.025"),
        (" AMI : 2.9 % ", AdaptiveInterval(0.029), "ami:0.029"),
        ("fmi:7200", FixedInterval(7200.0, 14400.0), "fmi:7200"),
        (" Optimal ", Optimal(), "optimal"),
    ],
)
def test_a_rule_reads_back_from_its_text(text, rule, plain):
    assert parse_dwell(text) == rule
    assert str(parse_dwell(text)) == plain
    assert parse_dwell(plain) == rule


def test_a_rule_of_a_plug_in_must_be_one(monkeypatch):
    monkeypatch.setitem(DWELL_RULES._objects(), "mine", DwellKind(lambda text, longest_s: 60.0, str, False))
    with pytest.raises(InputError, match="dwell rule 'mine': read must return a DwellRule; it returned float"):
        parse_dwell("mine")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "no dwell rule is given.*fmi, ami, optimal"),
        ("fmj:600", "did you mean 'fmi'"),
        ("optimal:3", "must be 'optimal' alone"),
        ("value:1,1,1,1", "there is no dwell rule 'value'"),
        ("600", "'600' is a number without a rule -> write for example 'fmi:600'"),
        ("fmi", "has no number after 'fmi:'"),
        ("fmi:ten", "'ten' in 'fmi:ten' is not a finite number -> write for example"),
        ("fmi:inf", "not a finite number"),
        ("fmi:0", "not between 1 and 86400 s"),
        ("fmi:1e99999999999999999999", "is not a finite number"),
        ("ami:2.5", "did you mean 'ami:2.5%'"),
        ("ami:0", "not between 0.001 and 0.5 -> it is 1/sqrt"),
        ("ami:99", "not between 0.001 and 0.5 -> it is 1/sqrt"),
    ],
)
def test_what_is_not_a_rule_is_refused_with_a_remedy(text, message):
    with pytest.raises(InputError, match=message) as caught:
        parse_dwell(text)
    assert caught.value.mistakes[0].remedy


@pytest.mark.parametrize("longest_s", [0.0, -1.0, math.inf, math.nan])
def test_a_longest_dwell_that_is_none_is_refused(longest_s):
    with pytest.raises(InputError, match="longest dwell"):
        parse_dwell("ami:3%", longest_s)


@given(st.integers(10, 5000))
def test_the_threshold_is_met_by_the_counts_needed_and_not_by_one_less(tenth_permille):
    rule = parse_dwell(f"ami:{tenth_permille}e-4")
    n = rule.counts_needed
    assert n * tenth_permille**2 >= 10**8 > (n - 1) * tenth_permille**2
    assert rule.enough(n, 10.0)
    assert not rule.enough(n - 1, 10.0)


def test_a_dead_sensor_does_not_hold_the_robot_for_ever():
    rule = parse_dwell("ami:3%", longest_s=900)
    assert not rule.enough(0, 890)
    assert rule.enough(0, 900)
    assert "1112 counts" in rule.outcome(0, 900)
    assert "would need" not in rule.outcome(1112, 300)


def test_expected_dwell_counts_raw_neutrons():
    rule = parse_dwell("ami:2.5%")
    assert rule.expected_s(4.0) == 400
    assert rule.expected_s(4.0, factor=1.25) == 500, "raw rate = corrected rate / factor"
    for unknown in (0.0, -1.0, math.nan):
        assert rule.expected_s(unknown) == MAX_DWELL_S
    assert parse_dwell("fmi:600").expected_s(math.nan) == 600
    assert [parse_dwell("optimal", longest_s).expected_s(4.0) for longest_s in (30.0, 900.0)] == [30.0, 60.0]


@given(
    st.sampled_from(["fmi:600", "fmi:0.3e1", "ami:3%", "optimal"]),
    st.integers(0, 3000),
    st.floats(0, 5000, allow_nan=False),
)
def test_progress_is_one_exactly_when_it_is_enough(text, raw_counts, live_s):
    rule = parse_dwell(text)
    progress = rule.progress(raw_counts, live_s)
    assert 0 <= progress <= 1
    assert (progress == 1) == rule.enough(raw_counts, live_s)
    assert rule.outcome(raw_counts, live_s)
