"""Attitude: quaternions, rotations from directions, and the filters built on them."""

__all__: list[str] = []
