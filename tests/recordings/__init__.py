"""Recordings of `ros2 bag`, written by `rosbags` and `mcap` from what real servers published."""
