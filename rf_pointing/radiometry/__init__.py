"""What a dish learns from noise: fluxes of the sky, beams over discs, fits of scans, Y-factors."""
