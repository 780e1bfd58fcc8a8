# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Logger formats: YAML files that define the columns, and the reader that uses them."""
