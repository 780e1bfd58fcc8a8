"""The rclpy nodes. They declare parameters, wire, convert and publish; what they do is done by the core."""

import os

# To look for plugins pydantic would read the metadata of every package installed, which takes longer than all that
# it does for a node. Read when the first model is built.
os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
