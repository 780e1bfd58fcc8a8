"""Variogram models and their estimation from counts."""
