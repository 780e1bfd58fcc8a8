"""Stops, where the robot can travel, and how long that takes."""
