"""Solid and rods of one design side by side; the only part that knows both."""
