"""How the window looks: colours and type, drawn signs, text and numbers as a person reads them."""
