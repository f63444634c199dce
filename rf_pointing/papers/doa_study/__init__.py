"""The simulation behind `reproduce doa`: scene, direction errors, attitude runs."""

__all__: list[str] = []
