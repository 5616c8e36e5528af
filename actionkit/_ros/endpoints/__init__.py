"""An action in the ROS graph: its names, the nodes that have it, our entities for it."""
