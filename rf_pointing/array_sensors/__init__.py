"""array_sensors."""
