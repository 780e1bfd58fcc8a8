"""Data of known truth: surrogate fields and the virtual logger and robot that measure them."""
