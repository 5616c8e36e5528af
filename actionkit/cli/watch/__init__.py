"""Commands that look at the actions of others: `watch`, `info`, `list`. They change nothing."""
