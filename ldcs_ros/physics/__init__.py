"""The mechanics: lattice, effects, model. SI units everywhere; frame `ldcs_base`; no input or output here.

Every effect works on the flat coordinate vector of the whole system:

    q = [x_0, y_0, z_0, x_1, ...,  phi_left_1, ..., phi_right_n]

that is three coordinates a node in lattice order [m], then the link angles of the arms [rad], if the
scene has arms. `u` is its time derivative. Forces have the same layout [N, N m].
"""
