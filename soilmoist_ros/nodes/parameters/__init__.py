"""The parameter table of each node, its declaration and its checks."""
