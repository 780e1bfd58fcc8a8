"""Start and end of node processes, quality of service, and discovery on loopback."""
