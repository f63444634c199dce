"""Polarized interferometer: relative pose of two spacecraft from carrier phases and polarisation.

Each spacecraft carries an array of three elements and a centre; nine carriers in sequence give nine
two-way ranges and four polarisation couplings (PI83).
"""
