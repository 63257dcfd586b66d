"""The vehicle as seen by the ground station: identity, state, contact and missions."""
