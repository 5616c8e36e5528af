"""The hold: after a human has stopped the robot, agents send no goals until a human releases it."""
