"""Building interface packages (.msg, .srv, .action) with pip packages and a C++ compiler alone.

The generators come with rclpy's wheels; CMake, colcon and a ROS installation are not needed. Knows
nothing of the client, the servers or rclpy, and no terminal. From the top down:

- `build`: the steps for all packages of a folder; `staging`: one package, up to its libraries
- `source_tree`, `interface_file`, `field_names`: what is in the folder, checked line by line
- `dependencies`, `fingerprint`: the packages that are used; whether anything has changed
- `generators`: the only module that touches rosidl's generators
- `compiler`, `objects`, `libraries`: from C and C++ to libraries that Python loads
- `publish`, `distribution`, `build_record`: into place in one step; what pip knows of it
"""
