"""What runs fast."""
