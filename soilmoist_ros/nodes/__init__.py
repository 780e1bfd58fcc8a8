"""The rclpy nodes. They declare parameters, wire, convert and publish; what they do is done by the core."""

import os

# A node works on matrices of a few hundred rows: more threads than one make that slower beside other nodes, and
# change the last digits, so that a map could not be computed again bit for bit. Read when numpy is imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# To look for plugins pydantic would read the metadata of every package installed, which takes longer than all that
# it does for a node. Read when the first model is built.
os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
