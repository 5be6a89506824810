"""Other programs' tables of trials as data sets (`evenlight import`)."""
