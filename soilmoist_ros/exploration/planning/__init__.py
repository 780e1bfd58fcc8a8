"""The value of a measurement at a place, and the dwell there."""
