"""Common parts of the array sensors: rotations, orbits, ground stations, rigid body, filters."""

__all__: list[str] = []
