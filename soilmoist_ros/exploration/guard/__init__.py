# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Between mission and navigator: what may be driven, and what is watched meanwhile."""
