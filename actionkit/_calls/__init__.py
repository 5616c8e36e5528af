"""Calls and their attempts, from the user's arguments to the finished future."""
