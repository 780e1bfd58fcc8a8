"""Bags of ROS 1."""
