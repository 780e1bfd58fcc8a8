# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Names that moved to :mod:`soilmoist_ros.pipeline`, importable from here for one release."""

from soilmoist_ros.pipeline import FieldSurvey as FieldSurvey
from soilmoist_ros.pipeline import MapRun as MapRun
from soilmoist_ros.pipeline import open_survey as open_survey
