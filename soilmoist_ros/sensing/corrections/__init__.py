"""Factors for air pressure, humidity and incoming intensity; several detector tubes as one sensor."""
