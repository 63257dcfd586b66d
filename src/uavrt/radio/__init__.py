"""Where samples come from: radio programs, pipes and files behind one interface."""
