# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What the commands print: lines for people, JSON for programs, progress, and their exit codes."""
