"""Tables, GeoTIFF, GeoJSON and summary of a run."""
