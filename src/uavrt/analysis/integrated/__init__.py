"""Results of whole flights as pulses, pictures and records; the integrator process."""
