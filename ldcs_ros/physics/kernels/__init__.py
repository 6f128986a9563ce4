"""Compiled kernels that serve all effects of a scene together."""
