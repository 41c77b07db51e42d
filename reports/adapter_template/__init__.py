"""The files that `dropspin new-adapter` writes, in which it replaces the names; `my_engine.py` is a working adapter."""
