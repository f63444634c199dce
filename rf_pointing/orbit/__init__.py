"""Orbits from measurements: forces, batch and square-root estimates, and what could be known."""
