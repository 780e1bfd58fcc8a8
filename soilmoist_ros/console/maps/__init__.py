"""Pictures for the page: layers of the map, and what lies below them."""
