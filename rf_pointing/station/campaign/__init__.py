"""The calibration campaign: what can be tracked, what was observed, and which model is in force."""
