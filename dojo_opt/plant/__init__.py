"""What a controller meets: a simulator that is not its model, closed loops with it, and many of them."""
