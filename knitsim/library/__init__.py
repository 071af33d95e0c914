"""The public library: one fabric, its tests and what is read from them; each name is one of ``knitsim``."""
