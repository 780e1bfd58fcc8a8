"""Logger formats are data: YAML files that say which column means what, and the reader that uses them."""
