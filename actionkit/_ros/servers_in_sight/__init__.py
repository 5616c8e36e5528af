"""Finds the servers of an action, and whether they are alive."""
