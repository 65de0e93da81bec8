"""The blind benchmark of the diagnosis: rigs that make campaigns with a known cause, and their judge.

Apart from the installed package: nobody needs it who has an actuator of their own.
"""
