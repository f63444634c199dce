"""The front door: what `import rf_pointing as rp` offers; docs/api.md describes it."""
