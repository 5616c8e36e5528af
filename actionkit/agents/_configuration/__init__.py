"""The configuration of a toolbox."""
