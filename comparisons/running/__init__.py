"""Scenes driven through engines: recordings, processes of their own, start phases, ensembles, whole runs."""
