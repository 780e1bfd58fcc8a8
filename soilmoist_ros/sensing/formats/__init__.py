"""Logger formats: bytes of a log or a link to records."""
