"""Draws goals: for `actionkit timeline --svg`, and for notebooks."""
