"""Which processes run, when, and what happens when one dies.

`program` runs it all: `start` starts programs, `tree` keeps the processes of the table running,
`mission` carries out the operator's commands.
"""
