"""Neighbor lists: cells, search, numbering, rebuild on the device, and grains that fly along a known path."""
