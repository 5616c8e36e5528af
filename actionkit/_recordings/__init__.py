"""Reads goals back: from rosbag2 recordings, and from logs of `JsonLines`. It needs no ROS."""
