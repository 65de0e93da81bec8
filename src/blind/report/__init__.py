"""Tables, figures and the page of the blind benchmark."""
