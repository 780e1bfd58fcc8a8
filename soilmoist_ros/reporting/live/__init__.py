"""A mission in the terminal while it runs."""
