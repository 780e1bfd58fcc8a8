"""Surrogate fields: soil whose truth is known."""
