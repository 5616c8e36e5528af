"""Waiting for a call: coroutines of asyncio, trio and rclpy, and where nothing may block."""
