"""What ActionKit costs, beside hand-written rclpy clients: `python -m benchmarks`."""
