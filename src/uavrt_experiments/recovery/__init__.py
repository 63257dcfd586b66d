"""Kill every process of a flight, again and again: how fast is it back, and is a pulse lost?"""
