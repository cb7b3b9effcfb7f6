"""Which steps and repetitions does a trial hold, and what do the joints do in each of them.

Events of the feet (from forces and from the tracked body), cycles from 0 to 100 %, curves over them with mean and sd,
moments and powers with what the parameters leave uncertain, spatio-temporal values, and all of it beside what another
program wrote into the same file.
"""
