"""The output for users and CI: commands, views, the terminal, HTML, plots, replays, JUnit and Markdown."""

if __name__ != "dropspin.reports":  # in a checkout that is on the path
    raise ImportError("import dropspin.reports, not reports")
