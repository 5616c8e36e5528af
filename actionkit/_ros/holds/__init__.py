"""The hold: a human has stopped the robot, and agents send no goals until a human releases it."""
