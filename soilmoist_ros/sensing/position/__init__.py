"""NMEA sentences to fixes, and the position of a receiver at any time."""
