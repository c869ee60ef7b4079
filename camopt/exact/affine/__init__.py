"""A train's elements as pieces in which force and memory are affine, and the way back to the numbers of the scene."""
