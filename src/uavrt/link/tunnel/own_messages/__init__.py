"""Messages between a drone and a ground station of uavrt, and their seals."""
