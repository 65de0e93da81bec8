"""An independent simulated actuator that writes raw logs. Shares no code with what it judges.

The way of the data, a file a station::

    protocols      commanded pressure over time
    syringe_pump   commanded -> true pressure   (drive effects)
    actuator       true pressure -> true angle  (fractional core and actuator effects)
    flex_sensor    true angle -> divider voltage (sensor effects)
    converter      voltages -> 10-bit counts    (acquisition effects)
    clock          the board's micros()
    wire           rows -> bytes, and what a bad cable does to them

`bench` connects them and keeps their state from trial to trial, `actuators` holds the two
specimens, `campaign_writer` writes their campaigns.

For the recorder the bench stands behind a board: `board` is the board's program, `faults` what may
befall it, `pty_server` its serial port, and `serve` the command.

Every effect has a second form for the blind benchmark (`second_forms`, `second_moments`).
"""
