"""Planning in closed loop: the controller and what it is made of."""
