"""The printed numbers of the three documents as data, what the runs give for them, and the verdict on each."""
