"""Records merged into samples."""
