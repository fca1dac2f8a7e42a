"""underlay: the stiffness of a thin layer from an indentation curve, with the substrate in the model."""
