"""An independent simulated actuator that writes raw logs. Shares no code with what it judges."""
