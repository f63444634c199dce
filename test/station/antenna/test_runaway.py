"""A drive that runs away on the whole simulated antenna, and none that does in hours of wind and hard motion."""
