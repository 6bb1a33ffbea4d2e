"""What records can tell apart, before any fit; which tests to make."""
