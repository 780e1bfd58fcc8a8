"""MCAP files: their records and chunks, the definitions of messages in them, and the description of a bag."""
