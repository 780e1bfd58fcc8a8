"""Tests of counts: bad tubes are masked, bad records are quarantined, each with its reason."""
