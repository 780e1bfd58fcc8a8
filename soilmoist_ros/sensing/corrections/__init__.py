"""Corrections of counts: pressure, humidity, incoming intensity, tubes."""
