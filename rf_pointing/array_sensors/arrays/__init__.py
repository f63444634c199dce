"""Antenna arrays as attitude and direction sensors."""

__all__: list[str] = []
