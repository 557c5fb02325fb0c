"""Sums per grain that the steps add up: energy and momentum budget (``budget``), flow through planes (``flow``).

A scene's ``measures`` ask for them; what it does not ask for is not compiled. The host reads them in ``warpdem.measure``.
"""
