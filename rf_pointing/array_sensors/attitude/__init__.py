"""What the array sensors share: rotations, orbits, ground stations, rigid body, filters."""

__all__: list[str] = []
