"""The life of one goal: a pure state machine."""
