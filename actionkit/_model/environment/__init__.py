"""What surrounds the process: the ROS domain, security, other processes."""
