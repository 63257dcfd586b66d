"""Geometry of the earth and of attitudes: WGS 84, local metres, quaternions."""
