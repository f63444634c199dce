"""The operator's page: its server, and the files that the browser loads."""
