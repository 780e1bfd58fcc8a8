"""The survey: corrects and places records one by one, from files, links or bags."""
