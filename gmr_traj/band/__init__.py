"""An interior-point method for programs whose unknowns couple along time, with Cholesky factors of a band."""
