"""The survey: records corrected and placed one by one, from files, links or bags."""
