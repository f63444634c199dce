"""Derivation from a station description: the parameter sets of every node, with their formulas.

Each module is one concern: functions of a `Band` that return the rows of a parameter set, each with
the key of the description that gives it and its formula as text.  `nodes` puts the rows into the
sets of each node.  The formulas reproduce what was measured on the 34-m antenna (`dss13.yaml`
overrides what they do not meet there) and scale with beam, encoder step, rates and mass.
"""
