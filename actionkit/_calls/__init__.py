"""One call and its attempts, from the user's arguments to the settled future."""
