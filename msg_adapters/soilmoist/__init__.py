"""Types of soilmoist_msgs. The import of each module fails if that package is not built."""
