"""Which stop is next."""
