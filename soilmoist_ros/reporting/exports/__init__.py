# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Files for geographic information systems, phones and farm terminals, made from the folder of a run."""
