"""What each photo shows at each point of the surface."""
