"""What every node process shares: start and end, quality of service, loopback discovery."""
