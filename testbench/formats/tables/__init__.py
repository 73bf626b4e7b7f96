"""Tables of samples: text, Parquet and MATLAB files, read in chunks."""
