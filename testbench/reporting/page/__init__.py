"""Components of a page: tables, figures, colours, templates."""
