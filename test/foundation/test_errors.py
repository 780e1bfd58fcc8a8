# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import pytest

from soilmoist_ros.foundation.errors import did_you_mean


@pytest.mark.parametrize(
    ("word", "meant"), [("pathces", "patches"), ("gyp", "gypsum_transect"), ("st", ""), ("", ""), ("zzz", "")]
)
def test_a_similar_word_or_the_only_one_that_begins_so_is_meant(word, meant):
    known = ["patches", "gypsum_transect", "station_kansas", "strips"]
    assert did_you_mean(word, known) == (f" (did you mean {meant!r}?)" if meant else "")
