# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Earlier surveys, covariates, and all that is known together."""

import pytest

from soilmoist_ros.mapping.knowledge.earlier import EarlierSurvey
from soilmoist_ros.mapping.knowledge.knowledge import NOTHING, Knowledge
from soilmoist_ros.mapping.samples.samples import NO_SAMPLES, Samples

ONE = Samples([(5.0, 5.0)], [300], [100.0])


def test_knowledge_is_empty_unless_something_is_known():
    assert NOTHING.is_empty
    assert not Knowledge(earlier=(EarlierSurvey("may", 0.0, ONE),)).is_empty


def test_an_earlier_survey_counts_once():
    may = EarlierSurvey("may", 0.0, ONE)
    with pytest.raises(ValueError, match="'may' is given twice"):
        Knowledge(earlier=(may, may))


def test_an_earlier_survey_needs_samples_and_a_time():
    with pytest.raises(ValueError, match="no samples"):
        EarlierSurvey("may", 0.0, NO_SAMPLES)
    with pytest.raises(ValueError, match="stamp_s"):
        EarlierSurvey("may", float("nan"), ONE)
    assert EarlierSurvey("may", 86_400.0, ONE).days_before(3 * 86_400.0) == 2.0
