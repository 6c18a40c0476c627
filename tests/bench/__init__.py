"""Benchmarks: `make bench-plan`, `make bench-sim`."""
