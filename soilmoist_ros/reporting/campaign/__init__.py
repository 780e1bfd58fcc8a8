"""Report of a campaign of simulated missions."""
