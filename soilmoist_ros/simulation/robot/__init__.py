"""Virtual robot, logger, GNSS receiver, navigation, links and clock."""
