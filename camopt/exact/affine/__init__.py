"""A train's elements as pieces with affine laws of force and memory, and forces over the cam angle as inputs."""
