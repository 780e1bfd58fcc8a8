"""Errors with a remedy, configuration files, geodesy, health: needed by all, knows nobody."""
