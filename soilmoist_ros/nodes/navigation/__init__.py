"""Navigators of the planner node, and the virtual navigation of the field simulator."""
