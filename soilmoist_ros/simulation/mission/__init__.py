"""One simulated mission: settings, simulator, errors of its map."""
