"""Commands with a server of their own: `demo` and `serve`."""
