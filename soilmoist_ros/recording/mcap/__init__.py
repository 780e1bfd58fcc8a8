# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""MCAP files: their records and chunks, the definitions of messages in them, and the description of a bag."""
