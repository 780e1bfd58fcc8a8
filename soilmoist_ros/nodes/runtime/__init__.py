"""Shared by all node processes: start and end, quality of service, discovery on loopback."""
