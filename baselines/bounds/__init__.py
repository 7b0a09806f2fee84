"""What no controller can beat on a realisation whose whole wind is known."""
