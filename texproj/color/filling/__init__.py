"""Colors where no photo sees, and between charts."""
