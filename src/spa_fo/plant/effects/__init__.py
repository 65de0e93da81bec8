"""Unmodelled effects, a file a stage, in the order a command passes through them.

``library`` says what each effect is called and what its parameters are; ``drive``, ``actuator``
and ``sensor`` hold the kernels; `spa_fo.plant.chain` connects them.
"""
