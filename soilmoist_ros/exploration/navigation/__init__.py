"""How goals reach the navigation of a robot, and what its answers mean."""
