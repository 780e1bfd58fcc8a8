"""Logger formats: YAML files that define the columns, and the reader that uses them."""
