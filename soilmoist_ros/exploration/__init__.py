"""Map + travel graph + clock -> where to measure next, and for how long."""
