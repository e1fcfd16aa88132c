"""Studies: each a table and a plot of what the program can do and what it costs."""
