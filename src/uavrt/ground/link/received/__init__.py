"""Handle the drone's reports: store them in the flight's files and show them on pages."""
