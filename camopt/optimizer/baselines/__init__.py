"""The cams of the literature under the same limits: the best member of each family, and the comparison."""
