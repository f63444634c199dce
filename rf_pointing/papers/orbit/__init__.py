"""Orbit check: does an orbit from corrected angles agree with the reference better than one from
raw angles?
"""
