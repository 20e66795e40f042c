"""Modes, requests and faults as tables, and the live state, declared once."""
