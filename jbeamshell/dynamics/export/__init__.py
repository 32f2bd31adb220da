"""Export of joints to other programs: one file for each target, and what all of them say."""
