"""Covariates from files: rasters, what is derived from elevations, and polygons of a soil map."""
