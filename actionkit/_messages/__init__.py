"""Converts plain Python values to ROS messages and back, with a check of each field."""
