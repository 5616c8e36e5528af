"""Plain Python values to ROS messages and back, checked field by field."""
