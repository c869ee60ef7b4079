"""`camopt.linearised`: paths of tied contacts and their derivatives, from either source."""
