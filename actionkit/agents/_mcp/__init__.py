"""`actionkit mcp`: a toolbox for any client of the Model Context Protocol.

`serving` runs a process that serves. Below it are `stdio` and `http`, the two ways in; `session`,
what is answered; `calls`, what is in flight; `ending`, why and until when the process ends.
"""
