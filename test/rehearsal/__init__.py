# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Missions against injected faults, with an independent judge: for ``scripts/safety`` and tests.

``cases`` are random fields and faults, drawn from a seed; ``world`` and ``servers`` are the robot, its receiver and its
navigation; ``planner`` is the real mission with its navigators; ``rehearsal`` adds a mapper and the people, ``disk``
the real files; ``judge`` shares no code with the guard of the package.
"""
