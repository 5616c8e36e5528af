"""The only room that touches rclpy."""
