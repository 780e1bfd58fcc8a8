"""All surveys of a field as a time series: maps, changes, files and a page."""
