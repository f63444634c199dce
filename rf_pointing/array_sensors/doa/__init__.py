"""Attitude of a satellite from the directions of ground signals on a circular array."""
