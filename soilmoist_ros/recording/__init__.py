"""Runs on disk: bags that survive a crash, how to read and recover them, and the mission's journal."""
