"""NMEA sentences -> fixes, and the position of a receiver at any moment."""
