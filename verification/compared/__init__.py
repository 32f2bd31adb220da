"""Methods that could solve the same scenes, compared on the same scenes, by numbers that decide.

Friction laws, load control, iterations, grids, load steps against events, shooting, contact.  What
the library has is called; what it lacks is written here, each in a small file, to be measured and
to fail where all can see it.  All of it, into methods.json and methods.png beside this package, in
half an hour on a core:

    python -m calibration.methods [--only SECTION ...] [--quick] [--draw]

--only computes these sections anew, --quick takes few values of each, --draw only draws the record.
"""
