"""Services of a station: targets that never set, and what is learned of their motion."""
