"""A layer that stiffens as it is indented, and finite strain: factors on the exact law of a sphere.

`factors` are the formulas, those of a contact made little by little among them, `limits` what is refused, and `law`
the numbers of a layer (`Gent`) and the law of its contact.
"""
