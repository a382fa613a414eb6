"""Tables 3.1 to 3.3 of Piqué 2018 on simulated arms, made again: study and page."""
