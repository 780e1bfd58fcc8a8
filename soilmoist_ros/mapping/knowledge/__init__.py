"""What is known of a field besides the counts of the survey: earlier surveys, covariates, drift."""
