"""Measure a dish by the noise of the sky: fluxes, beams over discs, fits of scans, Y-factors."""
