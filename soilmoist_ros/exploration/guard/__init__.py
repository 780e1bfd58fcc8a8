"""Between mission and navigator: what may be driven, and what is watched meanwhile."""
