"""Types of nav2_msgs; each adapter is given the class, so that it can be imported without that package."""
