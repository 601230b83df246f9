"""Files become maps and maps become files."""
