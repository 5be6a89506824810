"""Reading and writing files: text and tables, logs that only grow, results that appear whole."""
