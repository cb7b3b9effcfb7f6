"""The sessions of an archive, thousands of them: each gone through once, in a process that may die."""
