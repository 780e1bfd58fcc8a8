# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The map that readers can question: its data for the page's script, and its pictures for paper."""
