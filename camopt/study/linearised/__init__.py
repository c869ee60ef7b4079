"""`camopt.linearised`: paths of motions with tied contacts and their derivatives, smooth or exact."""
