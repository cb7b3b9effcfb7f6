"""How well biodance works, measured: `python -m benchmarks NAME ...` runs the file of that name; without a name it says
which there are. The tables of docs/benchmarks come from here.
"""
