"""The console command `dropspin`: what is installed comes before what lies about, then the command line.

A module of a name that nobody else's is. Whoever runs `dropspin` in a repository of their own may have folders `scenarios`, `reports` or
`comparisons` there, and PYTHONPATH=. would put them before dropspin's packages of the same names, before anything of these could run.
"""

import os
import sys


def main() -> None:
    """Run the command line with the user's modules where they are found, but last: nothing there hides what is installed."""
    home = os.path.dirname(os.path.abspath(__file__))
    named = os.environ.get("PYTHONPATH", "").split(os.pathsep)
    last = [place for place in dict.fromkeys(map(os.path.abspath, [*named, os.getcwd()])) if place != home]
    sys.path[:] = [place for place in sys.path if os.path.abspath(place) not in last] + last
    from reports.cli import main as command_line

    command_line()


if __name__ == "__main__":
    main()
