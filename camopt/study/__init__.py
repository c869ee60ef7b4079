"""The verbs beside `optimize` and `verify`: a folder each, or a file where one is enough."""
