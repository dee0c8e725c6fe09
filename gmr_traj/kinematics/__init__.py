"""One robot description, three users: MuJoCo (numbers), CasADi (the problem), Pinocchio (dynamics, and the check)."""
