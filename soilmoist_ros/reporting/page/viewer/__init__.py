"""The map that readers can question: its data for the page's script, and its pictures for paper."""
