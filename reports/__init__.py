"""The output for users and CI: commands, views, the terminal, HTML, plots, replays, JUnit and Markdown."""
