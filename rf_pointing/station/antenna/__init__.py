"""antenna."""
