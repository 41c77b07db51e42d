"""Modules that turn results into sentences and table rows, without HTML or terminal codes; most commands have a module of their own."""
