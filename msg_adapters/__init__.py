"""Core dataclasses <-> ROS messages."""
