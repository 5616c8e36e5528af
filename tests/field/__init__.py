"""Action servers that nobody in this project wrote: `pytest --combination field`.

Their sources, and small servers on top of them, are in `../shared/field`. What the tests expect
comes from the server's own log.
"""
