"""Bags in the rosbag2 layout (MCAP): write, read, recover and play them. The public names are in ``recording``."""
