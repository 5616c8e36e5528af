"""Works around faults of Fast DDS, of its default settings, and of ROS's wheels.

Each module says in its last paragraph when it can be deleted.
"""
