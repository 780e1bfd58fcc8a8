"""The rclpy nodes. They declare parameters, wire, convert and publish; what they do is done by the core."""
