"""The compiled kernel of event-exact: spans by exact propagators, and every switching located inside them."""
