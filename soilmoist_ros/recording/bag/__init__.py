"""Bags in the rosbag2 layout (MCAP): write, read, recover, play."""
