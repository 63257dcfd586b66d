"""The vehicle as the ground receives it: identity, state, contact, missions."""
