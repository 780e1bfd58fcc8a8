"""What a measurement at a place is worth, and how long to count there."""
