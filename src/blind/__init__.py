"""The blind benchmark: rigs that make campaigns with a known cause, and the judge of the answers.

Apart from the installed package: nobody needs it who has an actuator of their own.
"""
