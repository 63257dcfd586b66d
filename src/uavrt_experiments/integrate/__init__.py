"""What judging whole flights reaches, measured: false alarms, range, place, cost."""
