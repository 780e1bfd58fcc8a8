"""NMEA sentences, positions and the track."""
