"""Orbit check of a calibration: do corrected angles give a better orbit than raw ones?"""
