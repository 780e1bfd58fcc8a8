# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The tests of this folder share the module ``scripted_server``."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
