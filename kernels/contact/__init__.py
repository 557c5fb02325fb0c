"""Contacts between grains: the law that joins normal, tangential and rolling model, and the evaluation of many contacts.

    columns           what the numbers of a contact are, by name: coefficients, constants, contact history
    normal_law        one form for all normal laws
    law               force and torque of one contact from the three models
    history           the contact history of one contact as a vector
    pairs             one contact of two grains, from their records to what each of them gets
    sweep             many of them in the lanes of a CPU core's registers
    thread_contact    one of them in a GPU thread, or on a CPU where the law cannot be in lanes
    dissipation       what each part of the law takes from the grains, for the energy budget

The law is also that of walls; where a grain touches a wall, ``kernels.wall`` says.
"""
