"""Targets that reports lead to, as a station follows them."""
