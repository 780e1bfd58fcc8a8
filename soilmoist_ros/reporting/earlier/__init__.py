"""Finished runs as earlier surveys of the field that is being mapped."""
