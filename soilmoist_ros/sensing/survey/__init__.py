"""Records corrected and placed, from files or from links."""
