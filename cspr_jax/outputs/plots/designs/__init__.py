"""Pictures and pages of designs."""
