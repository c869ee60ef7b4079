"""The live designer: `session` answers from the numbers of an edited scene while a limit is dragged; `server` brings it
to a browser on this machine and `widget` into a notebook, both with the one ES module in `page`."""
