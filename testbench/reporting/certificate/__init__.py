"""Certificates after ISO/IEC 17025:2017, 7.8: a record, and the page that is set from it."""
