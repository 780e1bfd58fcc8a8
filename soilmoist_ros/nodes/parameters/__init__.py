"""Declaration and checks of node parameters, and the table of each node."""
