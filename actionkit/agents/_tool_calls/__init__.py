"""Calls of tools: goals, latest messages of topics, and a human's stop."""
