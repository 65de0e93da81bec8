"""Unmodelled effects, a file each: what it is, its parameters, its kernels, its words.

``library`` puts them in the order a command passes through them; ``drive``, ``actuator`` and
``sensor`` are the stages that their kernels act in, and `spa_fo.plant.chain` connects these.
``own`` takes in effects that a campaign or an installed package brings along, and ``contract``
says what every effect has to keep.
"""
