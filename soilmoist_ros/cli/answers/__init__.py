"""What the commands print: lines for people, JSON for programs, progress, and their exit codes."""
