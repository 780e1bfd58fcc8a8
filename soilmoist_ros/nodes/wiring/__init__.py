"""Subscriptions and publishers that are too long for the file of their node."""
