"""Many simulated missions: file, workers, store, tables."""
