"""The compiled kernel of event-exact: it crosses spans by exact propagators and locates every switching inside them."""
