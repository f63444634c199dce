"""The tests mirror the package; CONTRIBUTING.md says which kinds there are."""
