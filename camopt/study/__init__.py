"""The verbs other than `optimize` and `verify`: one file each, or a folder where one file is not enough."""
