"""Array sensors: Tripulse, direction of arrival (DOA) and the polarized interferometer."""
