"""Tools of the command line that use ROS: looking at the graph, watching, cancelling."""
