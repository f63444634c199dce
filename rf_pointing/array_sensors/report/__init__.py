"""Report of the array sensors that a bag holds."""
