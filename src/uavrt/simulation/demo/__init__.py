"""Run the whole system with a simulated world on one computer.

`demo_run` flies one drone or several. `demo_search` and `search_together` run autonomous
searches. `demo_programs` starts the programs, `watch` and `view` show the progress, and
`summary` evaluates the flight.
"""
