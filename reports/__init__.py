"""What people and CI read: commands, views, the terminal, HTML, plots, replays, JUnit and Markdown."""
