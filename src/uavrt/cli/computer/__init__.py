"""Commands that check, set up and update this computer."""
