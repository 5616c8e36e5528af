"""`actionkit mcp`: a toolbox for any client of the Model Context Protocol.

`process` runs a process that serves, and ends it. Below it are `stdio` and `http`, the two ways in;
`session`, what is answered; `calls`, what is in flight.
"""
