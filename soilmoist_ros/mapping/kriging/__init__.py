"""Poisson kriging of samples onto points and rasters."""
