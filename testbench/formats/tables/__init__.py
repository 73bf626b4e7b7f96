"""Tables of samples: text, Parquet and MATLAB files read in pieces, and how their columns become
samples.
"""
