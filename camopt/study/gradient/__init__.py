"""`camopt gradient`: whether a gradient can be trusted."""
