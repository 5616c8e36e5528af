"""Questions to the ROS graph for the command line."""
