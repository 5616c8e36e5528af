"""The file in which goals are written down before they are sent, for the time after a crash."""
