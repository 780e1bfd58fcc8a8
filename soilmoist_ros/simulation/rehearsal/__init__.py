"""Rehearsal of a mission's whole control loop against injected faults, in simulated time and without ROS."""
