"""What a stage notices about data: one record, told alike by terminal, report, viewer and JSON."""
