"""Figures for publications: vector files with the widths of journal columns."""
