"""Sends goals and requests for their results, and finds the goal that an answer is about."""
