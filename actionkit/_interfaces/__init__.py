"""Builds interface packages (.msg, .srv, .action) with pip packages and a C++ compiler only.

The generators come with rclpy's wheels; CMake, colcon and a ROS installation are not needed. This
package uses neither the client nor the servers, rclpy or a terminal. From the top down:

- `build`: builds all packages of a folder that have changed; `wheel`: makes and installs the wheel
- `checks`: finds mistakes before anything is made; `selection`: some types and what they need
- `source_tree`, `interface_file`, `lines`: read what is in the folder, line by line
- `dependencies`: finds the packages that are used; `processes`: runs commands, many at a time
- `generators`: the only module that touches rosidl's generators; `compile`: from C to libraries
"""
