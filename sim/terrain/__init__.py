"""Ground that is no level plane."""
