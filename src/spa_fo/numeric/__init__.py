"""Penalised least squares and mixed linear models; nothing of actuators."""
