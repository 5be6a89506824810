"""From contrast loss to a brightness track: the problem of Eq. 6, its solvers, and a lower bound."""
