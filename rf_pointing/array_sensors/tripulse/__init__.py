"""tripulse."""
