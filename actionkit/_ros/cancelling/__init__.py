"""Cancels goals until the servers have answered: those of one client, and those of others."""
