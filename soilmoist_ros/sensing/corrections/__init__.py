"""Factors for air pressure, humidity and incoming intensity, and detector tubes as one sensor."""
