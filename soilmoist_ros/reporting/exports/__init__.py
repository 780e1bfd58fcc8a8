"""Files for geographic information systems, phones and farm terminals, made from the folder of a run."""
