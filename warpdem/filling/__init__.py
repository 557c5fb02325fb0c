"""Grains: where they come from at the start and while the run goes on."""
