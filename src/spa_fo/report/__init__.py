"""Figures, tables, and the audit of the paper."""
