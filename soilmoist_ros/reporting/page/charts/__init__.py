"""Charts as HTML and inline SVG: text keeps its size on every screen and in print."""
