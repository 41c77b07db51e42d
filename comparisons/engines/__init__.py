"""Engine adapters: a scene goes in, native steps come out; all conversions of convention happen here and nowhere else."""
