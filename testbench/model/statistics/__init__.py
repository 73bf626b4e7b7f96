"""One family of fitters: least squares, blocks, spread, robust, polynomial."""
