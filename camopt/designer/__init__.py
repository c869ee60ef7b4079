"""The live designer: a page, or a notebook's widget, that answers while a limit is dragged.

`session` answers requests from the numbers of an edited scene; `server` brings it to a browser on this machine and
`widget` into a notebook, both with the one ES module in `page`.
"""
