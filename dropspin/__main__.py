"""`python -m dropspin`: the command line."""

from dropspin import main

main()
