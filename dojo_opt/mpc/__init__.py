"""Model-predictive control: the controller, its references, policy and measurements."""
