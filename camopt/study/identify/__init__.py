"""`camopt.identify`: parameters of a train from its measured valve lift."""
