"""Runs a behaviour as real action servers of rclpy, in its own process or a test's."""
