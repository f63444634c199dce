"""Polarized interferometer: relative position and attitude of two spacecraft from carrier phases and polarisation.

An array of three elements and a centre on each spacecraft, nine carriers in sequence, nine two-way ranges and four
polarisation couplings (PI83).  Design chain: `design`, `design_tables`, `link`, `mixer`; estimation: `initialize`,
`track`; over time: `InterferometerSource`, `InterferometerTracker`.
"""
