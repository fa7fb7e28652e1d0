"""Pictures and tables, made from results; nothing is computed here."""
