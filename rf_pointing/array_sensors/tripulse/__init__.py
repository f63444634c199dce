"""Tripulse: where a satellite's transmitting array points, measured at two ground stations."""
