"""The followers of a scene's [geometry]: from valve lift to where each touches its cam, and back from a contour."""
