"""Exact answers that only tests ask for."""
