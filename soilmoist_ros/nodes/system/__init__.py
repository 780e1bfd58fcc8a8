"""Runs several nodes as one system, for the demo and the launch files."""
