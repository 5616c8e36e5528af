"""Private parts of rclpy, and what depends on its release."""
