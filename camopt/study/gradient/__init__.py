"""`camopt gradient`: may the gradient be trusted here."""
