# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Charts as HTML and inline SVG: text keeps its size on every screen and in print."""
