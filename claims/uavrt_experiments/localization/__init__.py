"""Measured performance of bearings and positions, with requirements and theoretical bounds."""
