"""Several nodes as one system: the demonstration and the launch files."""
