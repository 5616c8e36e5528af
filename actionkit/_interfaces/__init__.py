"""Building interface packages (.msg, .srv, .action) with pip packages and a C++ compiler alone.

The generators come with rclpy's wheels; CMake, colcon and a ROS installation are not needed. Knows
nothing of the client, the servers or rclpy, and no terminal. From the top down:

- `build`: all packages of a folder that have changed, up to the wheel; `wheel`: where that goes
- `checks`, `selection`: what is wrong, before anything is made; some types with what they need
- `source_tree`, `interface_file`, `lines`: what is in the folder, line by line
- `dependencies`: the packages that are used; `processes`: commands, many at the same time
- `generators`: the only module that touches rosidl's generators; `compile`: from C to libraries
"""
