"""Cancels goals of any client, and says what happened to each. Needs no package of the action's."""
