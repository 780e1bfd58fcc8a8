"""From logger bytes to corrected, geo-tagged counts."""
