"""Building interface packages (.msg, .srv, .action) with pip packages and a C++ compiler alone.

The generators come with rclpy's wheels; CMake, colcon and a ROS installation are not needed. Knows
nothing of the client, the servers or rclpy, and no terminal. From the top down:

- `build`: all packages of a folder, each up to its wheel; `wheel`: where that goes
- `checks`, `selection`: what is wrong, before anything is made; some types with what they need
- `source_tree`, `interface_file`, `field_names`: what is in the folder, checked line by line
- `dependencies`, `fingerprint`: the packages that are used; whether anything has changed
- `generators`: the only module that touches rosidl's generators; `compile`: from C to libraries
"""
