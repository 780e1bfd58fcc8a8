"""Core dataclasses <-> ROS messages, both ways, and nothing else."""
