"""How well detectors trained on photographs see the actors of rendered pictures."""
