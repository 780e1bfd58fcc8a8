"""One mission on one robot: requests for a plan, other robots, navigation results, commands."""
