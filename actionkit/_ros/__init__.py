"""The only package that uses rclpy."""
