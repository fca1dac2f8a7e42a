"""From a vector of parameters to the readings of every curve, compiled once per problem."""
