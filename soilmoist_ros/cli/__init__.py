"""The ``soilmoist`` command."""
